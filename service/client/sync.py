"""The client of the HTTP API. `cusp submit` and `cusp demo` use it too.

    from service.client import Client, register

    print(register("design.stl", "scan.stl", tolerance_mm=0.1).result().verdict.status)

    with Client("http://127.0.0.1:8000") as cusp:
        design = cusp.put_blob("design.stl")                      # sent once for all scans
        jobs = [cusp.register(design, scan) for scan in scans]
        for job in jobs:
            result = job.result()                                 # raises ServiceProblem if the job failed
            print(result.verdict.status, result.metrics.rmse_mm)

`service.client.AsyncClient` has the same methods with `await`.
"""

import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any, Generic, Self, TypeVar, Unpack

import httpx
from tenacity import Retrying

from pipeline import LandmarksResult, RegistrationResult, StudyResult
from service.client import requests as calls
from service.client.requests import (
    DEFAULT_SERVER,
    PATIENCE_S,
    Call,
    JobOptions,
    OnSent,
    ServiceProblem,
    ServiceUnreachable,
)
from service.contract.schemas import Batch, Blob, FileEntry, Job, JobForecast, JobType

__all__ = ["Client", "Running", "ServiceProblem", "ServiceUnreachable", "register"]

R = TypeVar("R")
Result = TypeVar("Result", RegistrationResult, LandmarksResult, StudyResult)
Mesh = Path | str | Blob
WAIT_S = 20  # that one request may stay open


def _ignore(_: object) -> None:
    """The default listener."""


class Client:
    """A connection to one server. Not thread-safe; close it, or use it as a context manager."""

    def __init__(
        self,
        server: str = DEFAULT_SERVER,
        api_key: str | None = None,
        *,
        patience_s: float = PATIENCE_S,
        keep_alive: bool = True,
    ) -> None:
        """api_key : by default `CUSP_API_KEY` of the environment, if set; patience_s : how long a call is
        repeated while the service does not answer or is busy; keep_alive : as `requests.connection`
        """
        self.server = server.rstrip("/")
        self._patience_s = patience_s
        self._http = httpx.Client(**calls.connection(self.server, api_key, keep_alive=keep_alive))

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Drop the connections."""
        self._http.close()

    def is_ready(self) -> bool:
        """True if the service answers and accepts jobs."""
        try:
            return self._http.get("/readyz").status_code == httpx.codes.OK
        except httpx.TransportError:
            return False

    def register(
        self, design: Mesh, scan: Mesh, **options: Unpack[JobOptions]
    ) -> "Running[RegistrationResult]":
        """Start a registration. options : as in the API, `tolerance_mm=0.1, label="part 42"`."""
        return Running(
            self, self._start("registration", {"design": design, "scan": scan}, options), RegistrationResult
        )

    def landmarks(self, mesh: Mesh, **options: Unpack[JobOptions]) -> "Running[LandmarksResult]":
        """Start a search for segments and landmarks."""
        return Running(self, self._start("landmarks", {"mesh": mesh}, options), LandmarksResult)

    def study(self, mesh: Mesh, **options: Unpack[JobOptions]) -> "Running[StudyResult]":
        """Start a study of the landmarks of a mesh."""
        return Running(self, self._start("study", {"mesh": mesh}, options), StudyResult)

    def submit(
        self,
        mesh: Path,
        scan: Path | None = None,
        options: Mapping[str, Any] | None = None,
        *,
        job_type: JobType = "registration",
        on_sent: OnSent | None = None,
    ) -> Job:
        """Upload the files in a form and start a job. Returns when the job is accepted.

        Parameters
        ----------
        mesh : the design of a registration; of the other types, the mesh
        scan : of a registration only
        on_sent : called with the number of further bytes sent
        """
        first = "design" if job_type == "registration" else "mesh"
        meshes: dict[str, Path | Blob] = {first: mesh} if scan is None else {first: mesh, "scan": scan}
        return self._do(calls.submit(job_type, meshes, options or {}, on_sent=on_sent))

    def put_blob(self, mesh: Path | str) -> Blob:
        """Upload one mesh for later jobs."""
        return self._do(calls.put_blob(Path(mesh)))

    def submit_batch(
        self,
        design: Mesh | Mapping[str, Any],
        scans: Sequence[Mesh | Mapping[str, Any]],
        *,
        batch_label: str | None = None,
        batch_webhook: Mapping[str, str] | None = None,
        **options: Unpack[JobOptions],
    ) -> Batch:
        """Start a job for each of up to 1,000 scans of one design. Files are sent as blobs first.

        scans : each a file, a blob, `{"url": ...}`, or `{"scan": one of these, "reference": {...}, "label":
        ...}`; options : of every job
        """
        sent = []
        for each in scans:
            of_scan = each if isinstance(each, Mapping) and "scan" in each else {"scan": each}
            sent.append({**of_scan, "scan": self._ref(of_scan["scan"])})
        ref = self._ref(design)
        return self._do(calls.submit_batch(ref, sent, options, batch_label, batch_webhook))

    def _ref(self, mesh: Mesh | Mapping[str, Any]) -> Mapping[str, Any]:
        """As requests name it; a file is sent as a blob."""
        if isinstance(mesh, Mapping):
            return mesh
        if isinstance(mesh, Blob):
            return {"blob": mesh.id}
        blob = self.put_blob(mesh)
        return {"blob": blob.id, "filename": Path(mesh).name}

    def batch(self, batch_id: str) -> Batch:
        """The present state of a batch."""
        return self._do(calls.batch(batch_id))

    def batches(self, label: str | None = None, limit: int = 20) -> list[Batch]:
        """The newest batches."""
        return self._do(calls.batches(label, limit))

    def batch_table(self, batch_id: str) -> str:
        """CSV with a row for each scan."""
        return self._do(calls.batch_table(batch_id))

    def cancel_batch(self, batch_id: str) -> Batch:
        """Cancel every job of a batch that has not ended; results are kept."""
        return self._do(calls.cancel_batch(batch_id))

    def retry_batch(self, batch_id: str) -> Batch:
        """Start a new job for each scan whose job failed."""
        return self._do(calls.retry_batch(batch_id))

    def put_characteristics(
        self,
        design: Blob | str,
        document: Mapping[str, Any],
        *,
        if_match: str | None = None,
        only_new: bool = False,
    ) -> str:
        """Keep named regions, limits and an alignment with a design, for all later jobs on it. Returns their
        version (ETag). if_match : the version that they must still have; only_new : nothing may be kept yet
        """
        return self._do(calls.put_characteristics(_id_of(design), document, if_match, only_new=only_new))

    def characteristics_version(self, design: Blob | str) -> str:
        """The version (ETag) of what is kept with a design. Raises ServiceProblem `no_characteristics`."""
        return self._do(calls.characteristics_version(_id_of(design)))

    def characteristics(self, design: Blob | str) -> dict[str, Any]:
        """What is kept with a design. Raises ServiceProblem `no_characteristics`."""
        return self._do(calls.characteristics(_id_of(design)))

    def delete_characteristics(self, design: Blob | str) -> None:
        """Forget what is kept with a design."""
        self._do(calls.delete_characteristics(_id_of(design)))

    def job(self, job_id: str) -> Job:
        """The present status of a job."""
        return self._do(calls.job(job_id))

    def forecast(self, job_id: str) -> JobForecast:
        """Elapsed time, place in the queue and an estimate of the time left."""
        return self._do(calls.forecast(job_id))

    def options(self, job_id: str) -> dict[str, Any]:
        """What was asked of a job; another job can ask the same."""
        return self._do(calls.options(job_id))

    def wait_batch(
        self,
        batch_id: str,
        on_update: Callable[[Batch], None] = _ignore,
        *,
        interval_s: float = 1.0,
        timeout_s: float | None = None,
    ) -> Batch:
        """Poll until every job of a batch is final; `on_update` is called with every state.

        Raises
        ------
        TimeoutError
            If it is not finished after `timeout_s`; it continues to run.
        """
        deadline = None if timeout_s is None else time.monotonic() + timeout_s
        while True:
            batch = self.batch(batch_id)
            on_update(batch)
            if batch.status == "finished":
                return batch
            if deadline is not None and time.monotonic() > deadline:
                raise TimeoutError(f"batch {batch_id} is {batch.status} after {timeout_s} s")
            time.sleep(interval_s)

    def wait(
        self,
        job_id: str,
        on_update: Callable[[Job], None] = _ignore,
        *,
        interval_s: float = 0.2,
        timeout_s: float | None = None,
    ) -> Job:
        """Poll until the job is final; `on_update` is called with every status, the last one included.

        Raises
        ------
        TimeoutError
            If the job is not final after `timeout_s`; it continues to run.
        """
        deadline = None if timeout_s is None else time.monotonic() + timeout_s
        while True:
            job = self.job(job_id)
            on_update(job)
            if job.is_final:
                return job
            if deadline is not None and time.monotonic() > deadline:
                raise TimeoutError(f"job {job_id} is {job.status} after {timeout_s} s")
            time.sleep(interval_s)

    def results(self, job_id: str) -> dict[str, Any]:
        """results.json. Raises ServiceProblem if the job failed."""
        return self._do(calls.results(job_id))

    def files(self, job_id: str) -> list[FileEntry]:
        """The files of a job."""
        return self._do(calls.files(job_id))

    def download(self, job_id: str, name: str, path: Path) -> Path:
        """Stream one file of the job to `path`; an interrupted transfer leaves no file."""
        partial = path.with_name(path.name + ".part")
        try:
            with self._http.stream("GET", f"/v1/jobs/{job_id}/files/{name}") as answer:
                if answer.is_error:
                    answer.read()
                    raise calls.problem_of(answer)
                with partial.open("wb") as file:
                    for chunk in answer.iter_bytes():
                        file.write(chunk)
        except httpx.TransportError as error:
            raise calls.unreachable(self.server, error) from error
        else:
            return partial.replace(path)
        finally:
            partial.unlink(missing_ok=True)

    def cancel(self, job_id: str) -> Job:
        """Cancel a waiting or running job; never removes results. Raises ServiceProblem `job_final` if it has
        ended.
        """
        return self._do(calls.cancel(job_id))

    def dismiss(self, job_id: str) -> None:
        """Dismiss a waiting or running job; remove a final one."""
        self._do(calls.dismiss(job_id))

    def _start(self, job_type: JobType, meshes: Mapping[str, Mesh], options: Mapping[str, Any]) -> Job:
        sources = {name: mesh if isinstance(mesh, Blob) else Path(mesh) for name, mesh in meshes.items()}
        if any(isinstance(mesh, Blob) for mesh in sources.values()):  # then all are sent as blobs
            sources = {
                name: self.put_blob(mesh) if isinstance(mesh, Path) else mesh
                for name, mesh in sources.items()
            }
        return self._do(calls.submit(job_type, sources, options))

    def _do(self, call: Call[R]) -> R:
        answer: R = Retrying(**calls.patience(self._patience_s, call))(self._once, call)
        return answer

    def _once(self, call: Call[R]) -> R:
        with ExitStack() as opened:
            try:
                return call.answer(self._http.request(call.method, call.path, **call.request(opened)))
            except httpx.TransportError as error:
                raise calls.unreachable(self.server, error) from error


@dataclass(frozen=True, slots=True)
class Running(Generic[Result]):
    """A job that was started. job : its status when it was accepted"""

    client: Client
    job: Job
    _type: type[Result]

    @property
    def id(self) -> str:
        """The id of the job; enough for another process to continue."""
        return self.job.id

    def result(self, timeout_s: float | None = None) -> Result:
        """Wait for the end, and return the results.

        Raises
        ------
        ServiceProblem
            If the job failed or was dismissed.
        TimeoutError
            If it is not final after `timeout_s`; it continues to run.
        """
        deadline = float("inf") if timeout_s is None else time.monotonic() + timeout_s
        while not self.client._do(calls.job(self.id, wait_for(deadline))).is_final:
            if time.monotonic() >= deadline:
                raise TimeoutError(f"job {self.id} is not final after {timeout_s} s")
        return self.client._do(calls.typed_results(self.id, self._type))

    def download(self, folder: Path | str) -> list[Path]:
        """Download every file of the job to a folder, which is created if missing."""
        target = Path(folder)
        target.mkdir(parents=True, exist_ok=True)
        return [
            self.client.download(self.id, file.name, target / file.name)
            for file in self.client.files(self.id)
        ]

    def dismiss(self) -> None:
        """Dismiss or remove the job."""
        self.client.dismiss(self.id)


def _id_of(design: Blob | str) -> str:
    return design.id if isinstance(design, Blob) else design


def wait_for(deadline: float) -> int:
    """Whole seconds that one request may wait."""
    return max(1, int(min(WAIT_S, deadline - time.monotonic())))


def register(
    design: Mesh,
    scan: Mesh,
    *,
    server: str = DEFAULT_SERVER,
    api_key: str | None = None,
    **options: Unpack[JobOptions],
) -> Running[RegistrationResult]:
    """Start a registration: `register("design.stl", "scan.stl", tolerance_mm=0.1).result()`."""
    return Client(server, api_key, keep_alive=False).register(design, scan, **options)
