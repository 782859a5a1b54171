"""Requests and answers of a client, independent of the transport: shared by `Client` and `AsyncClient`.

A call is repeated for `patience_s` seconds while the service does not answer, or answers 429 or 503. This is
safe: the id of a blob is the hash of its content, and each new job has an `Idempotency-Key`.
"""

import json
import os
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from io import BufferedReader
from pathlib import Path
from typing import Any, BinaryIO, Generic, Literal, TypedDict, TypeVar
from uuid import uuid4

import httpx
from pydantic import BaseModel, ValidationError
from tenacity import RetryCallState, retry_if_exception, stop_after_delay, wait_exponential

from pipeline import Unit
from service.contract.job_types import MESHES
from service.contract.schemas import (
    Batch,
    BatchPage,
    Blob,
    FileEntry,
    FileList,
    Job,
    JobForecast,
    JobType,
    Problem,
)

DEFAULT_SERVER = "http://127.0.0.1:8000"
CONNECT_TIMEOUT_S = 5.0
TRANSFER_TIMEOUT_S = 300.0  # without any transferred byte
PATIENCE_S = 10.0
BUSY = (429, 503)

R = TypeVar("R")
Model = TypeVar("Model", bound=BaseModel)
OnSent = Callable[[int], None]


class JobOptions(TypedDict, total=False):
    """`options` of a request; all are optional. units : `{"scan": "inch"}`; webhook : `{"url": ...}`"""

    preset: Literal["default", "paper"]
    settings: Mapping[str, Any]
    units: Mapping[str, Unit]
    tolerance_mm: float | None
    scan_accuracy_mm: float | None
    acceptance: Mapping[str, Any]
    reference: Mapping[str, Any]
    alignment: Mapping[str, Any]
    design_part: str | None
    columns: str | None
    study: Mapping[str, Any]
    seed: int
    label: str | None
    webhook: Mapping[str, str]


class ServiceProblem(Exception):
    """The service refused a request. problem : the RFC 9457 document; retry_after_s : requested delay"""

    def __init__(self, problem: Problem, retry_after_s: float | None = None) -> None:
        self.problem = problem
        self.retry_after_s = retry_after_s
        super().__init__(f"{problem.title} ({problem.status} {problem.code}): {problem.detail}")


class ServiceUnreachable(Exception):
    """No service answers at the address."""


@dataclass(frozen=True, slots=True)
class Call(Generic[R]):
    """One request, and how its answer is parsed.

    files : parts of a form; body : a file that is the whole body; on_sent : called with the number of further
    bytes sent; is_repeatable : may be repeated although it may have arrived
    """

    method: str
    path: str
    parse: Callable[[httpx.Response], R]
    params: Mapping[str, str] = field(default_factory=dict)
    headers: Mapping[str, str] = field(default_factory=dict)
    document: Any = None
    files: Mapping[str, Path] = field(default_factory=dict)
    form: Mapping[str, str] = field(default_factory=dict)
    body: Path | None = None
    on_sent: OnSent | None = None
    is_repeatable: bool = True

    def request(self, opened: ExitStack) -> dict[str, Any]:
        """Arguments for httpx; files are opened on the stack, again for each attempt, and streamed."""
        arguments: dict[str, Any] = {"params": dict(self.params), "headers": dict(self.headers)}
        if self.document is not None:
            arguments["json"] = self.document
        if self.files:
            arguments["files"] = {
                name: (path.name, self._open(path, opened)) for name, path in self.files.items()
            }
            arguments["data"] = dict(self.form)
        if self.body is not None:
            arguments["content"] = self._open(self.body, opened)
            arguments["headers"]["Content-Length"] = str(self.body.stat().st_size)
        return arguments

    def _open(self, path: Path, opened: ExitStack) -> BinaryIO:
        file = opened.enter_context(path.open("rb"))
        return file if self.on_sent is None else _CountingReader(file, self.on_sent)

    def answer(self, response: httpx.Response) -> R:
        """Parse the answer. Raises ServiceProblem for an error."""
        if response.is_error:
            raise problem_of(response)
        return self.parse(response)


class _CountingReader(BufferedReader):
    """A file that reports how many bytes are read."""

    def __init__(self, file: BufferedReader, on_sent: OnSent) -> None:
        super().__init__(file.raw)
        self._on_sent = on_sent

    def read(self, size: int | None = -1, /) -> bytes:
        data = super().read(size)
        self._on_sent(len(data))
        return data


def submit(
    job_type: JobType,
    meshes: Mapping[str, Path | Blob],
    options: Mapping[str, Any],
    *,
    idempotency_key: str | None = None,
    on_sent: OnSent | None = None,
) -> Call[Job]:
    """Start a job. meshes : all files, or all blobs stored before"""
    key = {"Idempotency-Key": idempotency_key or uuid4().hex}
    if set(meshes) != set(MESHES[job_type]):
        wanted = " and ".join(MESHES[job_type])
        raise ValueError(f"a {job_type} job takes {wanted}, not {' and '.join(meshes) or 'nothing'}")
    blobs = {name: {"blob": mesh.id} for name, mesh in meshes.items() if isinstance(mesh, Blob)}
    files = {name: mesh for name, mesh in meshes.items() if isinstance(mesh, Path)}
    if not files:
        document = {"type": job_type, **blobs, "options": dict(options)}
        return Call("POST", "/v1/jobs", _job, headers=key, document=document)
    form = {"type": job_type, "options": json.dumps(dict(options))}
    return Call("POST", "/v1/jobs", _job, headers=key, files=files, form=form, on_sent=on_sent)


def put_blob(mesh: Path, on_sent: OnSent | None = None) -> Call[Blob]:
    return Call("PUT", "/v1/blobs", _blob, params={"filename": mesh.name}, body=mesh, on_sent=on_sent)


def job(job_id: str, wait_s: int = 0) -> Call[Job]:
    """wait_s : the service answers when the job is final, or after this time"""
    return Call("GET", f"/v1/jobs/{job_id}", _job, headers={"Prefer": f"wait={wait_s}"} if wait_s else {})


def forecast(job_id: str) -> Call[JobForecast]:
    return Call("GET", f"/v1/jobs/{job_id}/forecast", _forecast)


def options(job_id: str) -> Call[dict[str, Any]]:
    return Call("GET", f"/v1/jobs/{job_id}/options", _document)


def put_characteristics(
    design: str, document: Mapping[str, Any], if_match: str | None, *, only_new: bool = False
) -> Call[str]:
    headers = {} if if_match is None else {"If-Match": if_match}
    if only_new:
        headers["If-None-Match"] = "*"
    return Call("PUT", _kept(design), _etag, headers=headers, document=dict(document))


def characteristics_version(design: str) -> Call[str]:
    return Call("GET", _kept(design), _etag)


def characteristics(design: str) -> Call[dict[str, Any]]:
    return Call("GET", _kept(design), _document)


def delete_characteristics(design: str) -> Call[None]:
    return Call("DELETE", _kept(design), lambda _: None)


def _kept(design: str) -> str:
    return f"/v1/designs/{design}/characteristics"


def submit_batch(
    design: Mapping[str, Any],
    scans: Sequence[Mapping[str, Any]],
    options: Mapping[str, Any],
    label: str | None = None,
    webhook: Mapping[str, str] | None = None,
) -> Call[Batch]:
    """Start a job for each scan. design : as in the API, `{"blob": ...}`; scans : each `{"scan": {"blob":
    ...}, "reference": ..., "label": ...}`
    """
    document = {
        "design": dict(design),
        "scans": [dict(each) for each in scans],
        "options": dict(options),
        "label": label,
        "webhook": webhook and dict(webhook),
    }
    return Call("POST", "/v1/batches", _batch, headers={"Idempotency-Key": uuid4().hex}, document=document)


def batch(batch_id: str) -> Call[Batch]:
    return Call("GET", f"/v1/batches/{batch_id}", _batch)


def batches(label: str | None, limit: int) -> Call[list[Batch]]:
    params = {"limit": str(limit)} | ({} if label is None else {"label": label})
    return Call(
        "GET",
        "/v1/batches",
        lambda answer: BatchPage.model_validate_json(answer.content).batches,
        params=params,
    )


def batch_table(batch_id: str) -> Call[str]:
    return Call("GET", f"/v1/batches/{batch_id}/table.csv", lambda answer: answer.text)


def cancel_batch(batch_id: str) -> Call[Batch]:
    return Call("POST", f"/v1/batches/{batch_id}/cancel", _batch)


def retry_batch(batch_id: str) -> Call[Batch]:
    return Call("POST", f"/v1/batches/{batch_id}/retry", _batch)


def _batch(answer: httpx.Response) -> Batch:
    return Batch.model_validate_json(answer.content)


def results(job_id: str) -> Call[dict[str, Any]]:
    return Call("GET", f"/v1/jobs/{job_id}/results", _document)


def typed_results(job_id: str, model: type[Model]) -> Call[Model]:
    return Call("GET", f"/v1/jobs/{job_id}/results", lambda answer: model.model_validate_json(answer.content))


def files(job_id: str) -> Call[list[FileEntry]]:
    return Call(
        "GET", f"/v1/jobs/{job_id}/files", lambda answer: FileList.model_validate_json(answer.content).files
    )


def cancel(job_id: str) -> Call[Job]:
    return Call("POST", f"/v1/jobs/{job_id}/cancel", _job)


def dismiss(job_id: str) -> Call[None]:
    """Not repeatable: a second call would remove the job that the first one stopped."""
    return Call("DELETE", f"/v1/jobs/{job_id}?cancel=true", lambda _: None, is_repeatable=False)


def connection(server: str, api_key: str | None, *, keep_alive: bool = True) -> dict[str, Any]:
    """Arguments of an httpx client.

    api_key : by default `CUSP_API_KEY` of the environment, if set; keep_alive : False closes each connection
    after its call, so that the client need not be closed
    """
    key = api_key or os.environ.get("CUSP_API_KEY")
    return {
        "base_url": server,
        "timeout": httpx.Timeout(TRANSFER_TIMEOUT_S, connect=CONNECT_TIMEOUT_S),
        "headers": {"Authorization": f"Bearer {key}"} if key else {},
        "limits": httpx.Limits(max_keepalive_connections=None if keep_alive else 0),
        # A proxy cannot reach the loopback address of this machine.
        "trust_env": httpx.URL(server).host not in ("127.0.0.1", "::1", "localhost"),
    }


def patience(seconds: float, call: Call[Any]) -> dict[str, Any]:
    """Arguments of tenacity: repeat a call after transient errors for `seconds`."""

    def is_transient(error: BaseException) -> bool:
        if isinstance(error, ServiceProblem):
            return error.problem.status in BUSY
        if not isinstance(error, ServiceUnreachable):
            return False
        return call.is_repeatable or isinstance(error.__cause__, httpx.ConnectError)

    return {
        "retry": retry_if_exception(is_transient),
        "stop": stop_after_delay(seconds),
        "wait": _pause_s,
        "reraise": True,
    }


def _pause_s(state: RetryCallState) -> float:
    """The delay that the service asked for, else an exponential one."""
    error = None if state.outcome is None else state.outcome.exception()
    requested_delay = error.retry_after_s if isinstance(error, ServiceProblem) else None
    return wait_exponential(0.2, max=2)(state) if requested_delay is None else requested_delay


def unreachable(server: str, error: httpx.TransportError) -> ServiceUnreachable:
    reason = str(error) or type(error).__name__
    return ServiceUnreachable(f"no answer from {server}: {reason}; start the service with `cusp up`")


def problem_of(answer: httpx.Response) -> ServiceProblem:
    """The problem of an error answer; made from the status if a proxy sent it."""
    requested_delay = answer.headers.get("Retry-After", "")
    retry_after_s = float(requested_delay) if requested_delay.isdigit() else None
    try:
        return ServiceProblem(Problem.model_validate_json(answer.content), retry_after_s)
    except ValidationError:
        made = {
            "type": "about:blank",
            "title": answer.reason_phrase or "HTTP error",
            "status": answer.status_code,
            "detail": answer.text[:500],
            "code": "http_error",
        }
        return ServiceProblem(Problem.model_validate(made), retry_after_s)


def _job(answer: httpx.Response) -> Job:
    return Job.model_validate_json(answer.content)


def _forecast(answer: httpx.Response) -> JobForecast:
    return JobForecast.model_validate_json(answer.content)


def _blob(answer: httpx.Response) -> Blob:
    return Blob.model_validate_json(answer.content)


def _etag(answer: httpx.Response) -> str:
    return str(answer.headers.get("ETag", ""))


def _document(answer: httpx.Response) -> dict[str, Any]:
    document: dict[str, Any] = answer.json()
    return document
