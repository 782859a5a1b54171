"""The asynchronous client.

async with AsyncClient("http://127.0.0.1:8000") as cusp:
    jobs = [await cusp.register("design.stl", scan) for scan in scans]
    results = await asyncio.gather(*(job.result() for job in jobs))
"""

import asyncio
import time
from collections.abc import AsyncIterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any, BinaryIO, Generic, Self, Unpack

import httpx
from tenacity import AsyncRetrying

from pipeline import LandmarksResult, RegistrationResult, StudyResult
from service.client import requests as calls
from service.client.requests import DEFAULT_SERVER, PATIENCE_S, Call, JobOptions
from service.client.sync import Mesh, R, Result, _id_of, wait_for
from service.contract.schemas import Batch, Blob, FileEntry, Job, JobForecast, JobType

CHUNK = 1 << 20


class AsyncClient:
    """A connection to one server, for many calls at a time. Close it, or use it as a context manager."""

    def __init__(
        self, server: str = DEFAULT_SERVER, api_key: str | None = None, *, patience_s: float = PATIENCE_S
    ) -> None:
        """See `Client`."""
        self.server = server.rstrip("/")
        self._patience_s = patience_s
        self._http = httpx.AsyncClient(**calls.connection(self.server, api_key))

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        await self.close()

    async def close(self) -> None:
        """Drop the connections."""
        await self._http.aclose()

    async def register(
        self, design: Mesh, scan: Mesh, **options: Unpack[JobOptions]
    ) -> "AsyncRunning[RegistrationResult]":
        """Start a registration. options : as in the API, `tolerance_mm=0.1, label="part 42"`."""
        job = await self._start("registration", {"design": design, "scan": scan}, options)
        return AsyncRunning(self, job, RegistrationResult)

    async def landmarks(self, mesh: Mesh, **options: Unpack[JobOptions]) -> "AsyncRunning[LandmarksResult]":
        """Start a search for segments and landmarks."""
        return AsyncRunning(self, await self._start("landmarks", {"mesh": mesh}, options), LandmarksResult)

    async def study(self, mesh: Mesh, **options: Unpack[JobOptions]) -> "AsyncRunning[StudyResult]":
        """Start a study of the landmarks of a mesh."""
        return AsyncRunning(self, await self._start("study", {"mesh": mesh}, options), StudyResult)

    async def put_blob(self, mesh: Path | str) -> Blob:
        """Upload one mesh for later jobs."""
        return await self._do(calls.put_blob(Path(mesh)))

    async def submit_batch(
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
            sent.append({**of_scan, "scan": await self._ref(of_scan["scan"])})
        ref = await self._ref(design)
        return await self._do(calls.submit_batch(ref, sent, options, batch_label, batch_webhook))

    async def _ref(self, mesh: Mesh | Mapping[str, Any]) -> Mapping[str, Any]:
        """As requests name it; a file is sent as a blob."""
        if isinstance(mesh, Mapping):
            return mesh
        if isinstance(mesh, Blob):
            return {"blob": mesh.id}
        blob = await self.put_blob(mesh)
        return {"blob": blob.id, "filename": Path(mesh).name}

    async def batch(self, batch_id: str) -> Batch:
        """The present state of a batch."""
        return await self._do(calls.batch(batch_id))

    async def batches(self, label: str | None = None, limit: int = 20) -> list[Batch]:
        """The newest batches."""
        return await self._do(calls.batches(label, limit))

    async def batch_table(self, batch_id: str) -> str:
        """CSV with a row for each scan."""
        return await self._do(calls.batch_table(batch_id))

    async def cancel_batch(self, batch_id: str) -> Batch:
        """Cancel every job of a batch that has not ended; results are kept."""
        return await self._do(calls.cancel_batch(batch_id))

    async def retry_batch(self, batch_id: str) -> Batch:
        """Start a new job for each scan whose job failed."""
        return await self._do(calls.retry_batch(batch_id))

    async def put_characteristics(
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
        return await self._do(
            calls.put_characteristics(_id_of(design), document, if_match, only_new=only_new)
        )

    async def characteristics_version(self, design: Blob | str) -> str:
        """The version (ETag) of what is kept with a design. Raises ServiceProblem `no_characteristics`."""
        return await self._do(calls.characteristics_version(_id_of(design)))

    async def characteristics(self, design: Blob | str) -> dict[str, Any]:
        """What is kept with a design. Raises ServiceProblem `no_characteristics`."""
        return await self._do(calls.characteristics(_id_of(design)))

    async def delete_characteristics(self, design: Blob | str) -> None:
        """Forget what is kept with a design."""
        await self._do(calls.delete_characteristics(_id_of(design)))

    async def job(self, job_id: str) -> Job:
        """The present status of a job."""
        return await self._do(calls.job(job_id))

    async def forecast(self, job_id: str) -> JobForecast:
        """Elapsed time, place in the queue and an estimate of the time left."""
        return await self._do(calls.forecast(job_id))

    async def options(self, job_id: str) -> dict[str, Any]:
        """What was asked of a job; another job can ask the same."""
        return await self._do(calls.options(job_id))

    async def results(self, job_id: str) -> dict[str, Any]:
        """results.json. Raises ServiceProblem if the job failed."""
        return await self._do(calls.results(job_id))

    async def files(self, job_id: str) -> list[FileEntry]:
        """The files of a job."""
        return await self._do(calls.files(job_id))

    async def download(self, job_id: str, name: str, path: Path) -> Path:
        """Stream one file of the job to `path`; an interrupted transfer leaves no file."""
        partial = path.with_name(path.name + ".part")
        try:
            async with self._http.stream("GET", f"/v1/jobs/{job_id}/files/{name}") as answer:
                if answer.is_error:
                    await answer.aread()
                    raise calls.problem_of(answer)
                with partial.open("wb") as file:
                    async for chunk in answer.aiter_bytes():
                        await asyncio.to_thread(file.write, chunk)
        except httpx.TransportError as error:
            raise calls.unreachable(self.server, error) from error
        else:
            return partial.replace(path)
        finally:
            partial.unlink(missing_ok=True)

    async def cancel(self, job_id: str) -> Job:
        """Cancel a waiting or running job; never removes results. Raises ServiceProblem `job_final` if it has
        ended.
        """
        return await self._do(calls.cancel(job_id))

    async def dismiss(self, job_id: str) -> None:
        """Dismiss a waiting or running job; remove a final one."""
        await self._do(calls.dismiss(job_id))

    async def _start(self, job_type: JobType, meshes: Mapping[str, Mesh], options: Mapping[str, Any]) -> Job:
        """Send every mesh as a blob: reading a form from disk would block other calls."""
        sent = {
            name: mesh if isinstance(mesh, Blob) else await self.put_blob(mesh)
            for name, mesh in meshes.items()
        }
        return await self._do(calls.submit(job_type, sent, options))

    async def _do(self, call: Call[R]) -> R:
        return await AsyncRetrying(**calls.patience(self._patience_s, call))(self._once, call)

    async def _once(self, call: Call[R]) -> R:
        with ExitStack() as opened:
            arguments = call.request(opened)
            if "content" in arguments:
                arguments["content"] = _chunks(arguments["content"])
            try:
                return call.answer(await self._http.request(call.method, call.path, **arguments))
            except httpx.TransportError as error:
                raise calls.unreachable(self.server, error) from error


@dataclass(frozen=True, slots=True)
class AsyncRunning(Generic[Result]):
    """A job that was started. job : its status when it was accepted"""

    client: AsyncClient
    job: Job
    _type: type[Result]

    @property
    def id(self) -> str:
        """The id of the job; enough for another process to continue."""
        return self.job.id

    async def result(self, timeout_s: float | None = None) -> Result:
        """Wait for the end, and return the results; raises as `Running.result`."""
        deadline = float("inf") if timeout_s is None else time.monotonic() + timeout_s
        while not (await self.client._do(calls.job(self.id, wait_for(deadline)))).is_final:
            if time.monotonic() >= deadline:
                raise TimeoutError(f"job {self.id} is not final after {timeout_s} s")
        return await self.client._do(calls.typed_results(self.id, self._type))

    async def download(self, folder: Path | str) -> list[Path]:
        """Download every file of the job to a folder, which is created if missing."""
        target = Path(folder)
        target.mkdir(parents=True, exist_ok=True)
        files = await self.client.files(self.id)
        return [await self.client.download(self.id, file.name, target / file.name) for file in files]

    async def dismiss(self) -> None:
        """Dismiss or remove the job."""
        await self.client.dismiss(self.id)


async def _chunks(file: BinaryIO) -> AsyncIterator[bytes]:
    """Read in a thread, to keep the event loop free."""
    while chunk := await asyncio.to_thread(file.read, CHUNK):
        yield chunk
