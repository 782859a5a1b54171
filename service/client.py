"""A small synchronous client of the HTTP API: what `cusp submit` and `cusp demo` use, and yours if you like.

with Client("http://127.0.0.1:8000") as cusp:
    job = cusp.submit(Path("design.stl"), Path("scan.stl"), {"tolerance_mm": 0.1})
    job = cusp.wait(job.id)
    print(cusp.results(job.id)["verdict"]["status"])
    job = cusp.submit(Path("part.stl"), job_type="landmarks")
"""

import json
import os
import time
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import httpx
from pydantic import ValidationError

from service.job_types import MESHES
from service.schemas import Blob, FileEntry, FileList, Job, JobType, Problem

CONNECT_TIMEOUT_S = 5.0
TRANSFER_TIMEOUT_S = 300.0  # without a byte moving


class ServiceProblem(Exception):
    """The service said no; `problem` is its RFC 9457 document."""

    def __init__(self, problem: Problem) -> None:
        self.problem = problem
        super().__init__(f"{problem.title} ({problem.status} {problem.code}): {problem.detail}")


class ServiceUnreachable(Exception):
    """Nobody answers at the address."""


def _ignore(_: Job) -> None:
    """Listener for callers that do not watch."""


class Client:
    """Speaks to one server. Not thread-safe; close it, or use it as a context manager."""

    def __init__(self, server: str, api_key: str | None = None) -> None:
        """api_key : by default `CUSP_API_KEY` of the environment, if any."""
        self.server = server.rstrip("/")
        key = api_key or os.environ.get("CUSP_API_KEY")
        headers = {"Authorization": f"Bearer {key}"} if key else {}
        timeout = httpx.Timeout(TRANSFER_TIMEOUT_S, connect=CONNECT_TIMEOUT_S)
        is_near = httpx.URL(self.server).host in ("127.0.0.1", "::1", "localhost")
        # A proxy of the environment is for the world outside; it cannot reach this machine's own loopback.
        self._http = httpx.Client(base_url=self.server, timeout=timeout, headers=headers, trust_env=not is_near)

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
        """True when the service answers and can take jobs."""
        try:
            return self._http.get("/readyz").status_code == httpx.codes.OK
        except httpx.TransportError:
            return False

    def submit(
        self,
        mesh: Path,
        scan: Path | None = None,
        options: Mapping[str, Any] | None = None,
        *,
        job_type: JobType = "registration",
    ) -> Job:
        """Upload the files as `curl` would, and start a job. Returns at once, with the job accepted.

        Parameters
        ----------
        mesh : the design of a registration; of the other types, the mesh
        scan : of a registration only
        """
        given = [mesh] if scan is None else [mesh, scan]
        if len(given) != len(MESHES[job_type]):
            raise ValueError(f"a {job_type} job takes {' and '.join(MESHES[job_type])}, not {len(given)} file(s)")
        with ExitStack() as stack:
            files = {
                name: (path.name, stack.enter_context(path.open("rb")))
                for name, path in zip(MESHES[job_type], given, strict=True)
            }
            data = {"type": job_type, "options": json.dumps(dict(options or {}))}
            return Job.model_validate_json(self._call("POST", "/v1/jobs", files=files, data=data).content)

    def put_blob(self, mesh: Path) -> Blob:
        """Upload one mesh for later jobs."""
        with mesh.open("rb") as body:
            answer = self._call("PUT", "/v1/blobs", content=body, params={"filename": mesh.name})
        return Blob.model_validate_json(answer.content)

    def job(self, job_id: str) -> Job:
        """The status now."""
        return Job.model_validate_json(self._call("GET", f"/v1/jobs/{job_id}").content)

    def wait(
        self,
        job_id: str,
        on_update: Callable[[Job], None] = _ignore,
        *,
        interval_s: float = 0.2,
        timeout_s: float | None = None,
    ) -> Job:
        """Poll until the job is final; `on_update` hears every status, the last one included.

        Raises
        ------
        TimeoutError
            When the job is not final after `timeout_s`; it goes on running.
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
        """results.json; of a failed job, raises its problem."""
        results: dict[str, Any] = self._call("GET", f"/v1/jobs/{job_id}/results").json()
        return results

    def files(self, job_id: str) -> list[FileEntry]:
        """What can be downloaded."""
        return FileList.model_validate_json(self._call("GET", f"/v1/jobs/{job_id}/files").content).files

    def download(self, job_id: str, name: str, path: Path) -> Path:
        """Stream one file of the job to `path`; a broken transfer leaves no file behind."""
        partial = path.with_name(path.name + ".part")
        try:
            with self._http.stream("GET", f"/v1/jobs/{job_id}/files/{name}") as answer:
                if answer.is_error:
                    answer.read()
                    raise _problem_of(answer)
                with partial.open("wb") as file:
                    for chunk in answer.iter_bytes():
                        file.write(chunk)
        except httpx.TransportError as error:
            raise self._unreachable(error) from error
        else:
            return partial.replace(path)
        finally:
            partial.unlink(missing_ok=True)

    def dismiss(self, job_id: str) -> None:
        """Drop, kill or remove the job, whichever applies."""
        self._call("DELETE", f"/v1/jobs/{job_id}")

    def _call(self, method: str, path: str, **given: Any) -> httpx.Response:
        try:
            answer = self._http.request(method, path, **given)
        except httpx.TransportError as error:
            raise self._unreachable(error) from error
        if answer.is_error:
            raise _problem_of(answer)
        return answer

    def _unreachable(self, error: httpx.TransportError) -> ServiceUnreachable:
        reason = str(error) or type(error).__name__
        return ServiceUnreachable(f"no answer from {self.server}: {reason}; start the service with `cusp up`")


def _problem_of(answer: httpx.Response) -> ServiceProblem:
    """The problem of an answer; of something that is not ours (a proxy), one made from its status."""
    try:
        return ServiceProblem(Problem.model_validate_json(answer.content))
    except ValidationError:
        return ServiceProblem(
            Problem.model_validate(
                {
                    "type": "about:blank",
                    "title": answer.reason_phrase or "HTTP error",
                    "status": answer.status_code,
                    "detail": answer.text[:500],
                    "code": "http_error",
                }
            )
        )
