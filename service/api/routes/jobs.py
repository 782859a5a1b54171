"""Jobs: start, list, watch, download, dismiss."""

import re
import time
from collections.abc import AsyncIterator
from typing import Annotated, Any
from urllib.parse import quote

import structlog
from fastapi import APIRouter, Header, Path, Query, Request, Response
from fastapi.responses import StreamingResponse
from fastapi.sse import KEEPALIVE_COMMENT, format_sse_event

from pipeline import Decision, VerdictStatus
from service.api.dependencies import Api, UseApi
from service.api.digests import content_digest
from service.api.etags import conditional_json, is_known
from service.api.identity import Reads, Writes
from service.api.intake import accept_job
from service.api.job_watch import PING_INTERVAL_S
from service.api.problems import problem_response, problems
from service.api.request_bodies import JOB_BODY
from service.auth.keys import Caller
from service.contract.errors import (
    DeliveryNotFound,
    FileNotInJob,
    JobDismissed,
    JobFinal,
    JobNotFinal,
    JobNotFound,
)
from service.contract.schemas import (
    NO_NUL,
    Delivery,
    DeliveryList,
    FileList,
    Job,
    JobForecast,
    JobPage,
    JobType,
    Results,
    Status,
)
from service.jobs.models import JobRow
from service.jobs.views import files_of, forecast_of, job_of
from service.webhooks.outbox import delivery_list, delivery_of

JobId = Annotated[str, Path(description="`id` of the job", examples=["01a2019a-6685-7220-8c73-80d9802cf568"])]
FileName = Annotated[str, Path(description="as in the list of files", examples=["report.html"])]
MessageId = Annotated[
    str, Path(description="`id` of the message", examples=["msg_01a2019a66857220"], pattern=NO_NUL)
]
ReferenceText = Annotated[
    str | None,
    Query(max_length=100, pattern=NO_NUL, description="select by this value of `options.reference`"),
]


class EventStream(StreamingResponse):
    """Events that are encoded once for all that watch a job; FastAPI's own class encodes them for each."""

    media_type = "text/event-stream"

    def __init__(self, events: AsyncIterator[bytes]) -> None:
        super().__init__(events, headers={"Cache-Control": "no-cache", "X-Accel-Buffering": "no"})


router = APIRouter(prefix="/v1/jobs", tags=["jobs"])

RETRY_AFTER_S = 1
MAX_WAIT_S = 60
REPORT_POLICY = (
    "default-src 'none'; img-src data:; style-src 'unsafe-inline'; sandbox; frame-ancestors 'none'"
)
#: Of a DELETE that cancels without `cancel=true`: deprecated (RFC 9745) since 2026-11-27, removed in 0.3.
CANCELLED_BY_DELETE = {
    "Deprecation": "@1795737600",
    "Link": '</docs#/jobs>; rel="deprecation"; type="text/html"',
}
NOT_CHANGED: dict[int | str, dict[str, Any]] = {304: {"description": "Not changed since If-None-Match."}}
#: Of a server-sent event (OpenAPI 3.2, 4.14.4).
EVENT_SCHEMA = {
    "type": "object",
    "properties": {
        "data": {"type": "string"},
        "event": {"type": "string"},
        "id": {"type": "string"},
        "retry": {"type": "integer", "minimum": 0},
    },
}
log = structlog.get_logger()


@router.post(
    "",
    status_code=202,
    responses=problems(400, 401, 403, 413, 415, 422, 429, 503, 507),
    openapi_extra=JOB_BODY,
)
async def submit(
    request: Request,
    response: Response,
    api: UseApi,
    caller: Writes,
    idempotency_key: Annotated[
        str | None,
        Header(
            min_length=1,
            max_length=255,
            pattern=r"^[\x21-\x7e]+$",
            description="chosen by the client; with the same meshes and options it gives the same job",
        ),
    ] = None,
) -> Job:
    """Start a job. The meshes are files of a form, or blobs stored before.

    `type` is `registration` (the default), which registers `scan` to `design`; `landmarks`, which finds the
    segments and landmarks of one `mesh`; or `study`, which measures the value of landmarks of one `mesh`.
    """
    row = await accept_job(request, api, caller, idempotency_key)
    response.headers["Location"] = f"/v1/jobs/{row.id}"
    response.headers["Retry-After"] = str(RETRY_AFTER_S)
    return job_of(row)


@router.get("", responses=problems(401, 403, 422, 429))
def list_jobs(
    api: UseApi,
    caller: Reads,
    status: Annotated[Status | None, Query(description="select by this value")] = None,
    type: Annotated[JobType | None, Query(description="select by this value")] = None,  # noqa: A002 (the contract's word)
    label: Annotated[
        str | None,
        Query(
            max_length=200, pattern=NO_NUL, description="select by this value; `~text`: labels with the text"
        ),
    ] = None,
    name: Annotated[
        str | None,
        Query(
            max_length=200,
            pattern=NO_NUL,
            description="select by a part of the label, of a file name, of part number, serial number or "
            "batch; capitals do not count",
        ),
    ] = None,
    verdict: Annotated[VerdictStatus | None, Query(description="select by this value")] = None,
    decision: Annotated[Decision | None, Query(description="select by this value")] = None,
    serial: ReferenceText = None,
    batch: ReferenceText = None,
    part_number: ReferenceText = None,
    batch_id: Annotated[
        str | None, Query(max_length=36, pattern=NO_NUL, description="jobs of this batch")
    ] = None,
    limit: Annotated[int, Query(ge=1, le=1000, description="jobs on a page")] = 50,
    cursor: Annotated[
        str | None, Query(max_length=36, pattern=NO_NUL, description="`next` of the previous page")
    ] = None,
) -> JobPage:
    """List jobs, newest first."""
    rows, after = api.jobs.page(
        tenant=caller.tenant,
        status=status,
        job_type=type,
        label=label,
        name=name,
        equal={
            "verdict": verdict,
            "decision": decision,
            "serial": serial,
            "batch": batch,
            "part_number": part_number,
            "batch_id": batch_id,
        },
        before_id=cursor,
        limit=limit,
    )
    return JobPage(jobs=[job for row in rows if (job := _readable(row)) is not None], next=after)


def _readable(row: JobRow) -> Job | None:
    """None for a row that cannot be read (damaged, or of a later version): it must not hide the others."""
    try:
        return job_of(row)
    except (ValueError, AttributeError, TypeError):
        log.exception("a job is omitted from a list", job_id=row.id)
        return None


@router.get(
    "/{job_id}",
    response_model=Job,
    responses={**NOT_CHANGED, **problems(401, 403, 404, 429)},
)
async def status(
    job_id: JobId,
    request: Request,
    api: UseApi,
    caller: Reads,
    prefer: Annotated[
        str | None, Header(description="`wait=N`: answer when the job is final, or after N seconds")
    ] = None,
) -> Response:
    """Get the status of a job."""
    seconds = _seconds_to_wait(prefer)
    row = await api.read_job(job_id, caller)
    if seconds and not row.status.is_final:
        row = await _wait(api, row, caller, seconds)
    headers = {} if row.status.is_final else {"Retry-After": str(RETRY_AFTER_S)}
    if seconds:
        headers["Preference-Applied"] = f"wait={seconds}"
    return conditional_json(request, job_of(row).model_dump_json(), headers)


@router.get(
    "/{job_id}/events",
    response_class=Response,
    responses={
        200: {"content": {"text/event-stream": {"itemSchema": EVENT_SCHEMA}}},
        **problems(401, 403, 404, 429),
    },
)
async def events(job_id: JobId, api: UseApi, caller: Reads) -> Response:
    """Watch a job as server-sent events: `status` with the job whenever it changes, the last one final."""
    row = await api.read_job(job_id, caller)
    api.watch.check_room(caller.tenant)  # before the stream starts, so that one too many is a 429
    return EventStream(_events(api, row, caller))


async def _events(api: Api, first: JobRow, caller: Caller) -> AsyncIterator[bytes]:
    sent = format_sse_event(event="status", data_str=job_of(first).model_dump_json())
    yield sent
    if first.status.is_final:
        return
    async with api.watch.of(first.id, caller.tenant) as watched:
        version = 0
        while True:
            if not await watched.newer(version, PING_INTERVAL_S):
                yield KEEPALIVE_COMMENT
                continue
            version = watched.version
            if watched.row is None:  # removed meanwhile
                return
            if (now := watched.as_event()) != sent:
                sent = now
                yield sent
            if watched.row.status.is_final:
                return


@router.get("/{job_id}/forecast", responses=problems(401, 403, 404, 429))
def forecast(job_id: JobId, api: UseApi, caller: Reads) -> JobForecast:
    """Get the place of a job in the queue, and an estimate of the time that is left."""
    return forecast_of(api.jobs.forecast(api.job(job_id, caller)))


@router.get(
    "/{job_id}/results",
    response_model=Results,
    responses={**NOT_CHANGED, **problems(401, 403, 404, 409, 413, 415, 422, 429, 500)},
)
def results(job_id: JobId, request: Request, api: UseApi, caller: Reads) -> Response:
    """Get results.json, or the problem of a failed job."""
    row = api.job(job_id, caller)
    if row.status is Status.FAILED and row.error:
        return problem_response(row.error)
    _check_successful(row)
    return _download(api, request, row, "results.json", inline=True)


@router.get("/{job_id}/files", responses=problems(401, 403, 404, 409, 429))
def list_files(job_id: JobId, api: UseApi, caller: Reads) -> FileList:
    """List the files of a successful job."""
    row = api.job(job_id, caller)
    _check_successful(row)
    return files_of(row)


@router.get(
    "/{job_id}/files/{name}",
    response_class=StreamingResponse,
    responses={
        200: {"content": {"application/octet-stream": {}}},
        **NOT_CHANGED,
        **problems(401, 403, 404, 409, 429),
    },
)
def download(job_id: JobId, name: FileName, request: Request, api: UseApi, caller: Reads) -> Response:
    """Download a file of a successful job."""
    row = api.job(job_id, caller)
    _check_successful(row)
    return _download(api, request, row, name)


@router.get("/{job_id}/deliveries", responses=problems(401, 403, 404, 429))
def list_deliveries(job_id: JobId, api: UseApi, caller: Reads) -> DeliveryList:
    """List the messages to the webhook of a job, with their delivery attempts."""
    return delivery_list(api.deliveries.of_job(api.job(job_id, caller).id))


@router.post(
    "/{job_id}/deliveries/{message}/redeliver", status_code=202, responses=problems(401, 403, 404, 429)
)
def redeliver(job_id: JobId, message: MessageId, api: UseApi, caller: Writes) -> Delivery:
    """Send a message to the webhook of a job again, also one that was given up or delivered."""
    row = api.deliveries.redeliver(api.job(job_id, caller).id, message)
    if row is None:
        raise DeliveryNotFound(
            f"job {job_id} has no message {message[:80]!r}; see /v1/jobs/{job_id}/deliveries"
        )
    return delivery_of(row)


@router.post("/{job_id}/cancel", responses=problems(401, 403, 404, 409, 429))
def cancel(job_id: JobId, api: UseApi, caller: Writes) -> Job:
    """Cancel a waiting or running job. Never removes results: 409 if the job has ended meanwhile.

    To cancel a job that is dismissed already does nothing.
    """
    row = api.job(job_id, caller)
    if row.status.is_final and row.status is not Status.DISMISSED:
        raise JobFinal(
            f"job {job_id} is {row.status}; its results are kept. To remove it: DELETE /v1/jobs/{job_id}"
        )
    if row.status is not Status.DISMISSED and not api.jobs.dismiss(job_id, row.status):
        return cancel(job_id, api, caller)  # its status changed meanwhile, which happens a few times at most
    return job_of(api.job(job_id, caller))


@router.delete(
    "/{job_id}",
    status_code=204,
    response_class=Response,
    responses={
        204: {
            "headers": {
                "Deprecation": {
                    "description": "a job that had not ended was cancelled without `cancel=true`: use "
                    "POST /v1/jobs/{job_id}/cancel",
                    "schema": {"type": "string"},
                }
            }
        },
        **problems(401, 403, 404, 409, 422, 429),
    },
)
def dismiss(
    job_id: JobId,
    api: UseApi,
    caller: Writes,
    cancel: Annotated[
        bool | None,
        Query(
            description="also cancel a job that has not ended; `false`: refuse then (409). Without it such a "
            "job is cancelled too, which is deprecated"
        ),
    ] = None,
) -> Response:
    """Remove a job that has ended, with its results. One that has not ended is cancelled, with `cancel`."""
    row = api.jobs.find(job_id, caller.tenant)
    if row is None:
        raise JobNotFound(f"no job has the id {job_id!r}")
    if row.status.is_final:
        api.jobs.remove(job_id)
        api.blobs.remove_results(job_id)  # on each call: an earlier one may have been interrupted
        return Response(status_code=204)
    if cancel is False:
        raise JobNotFinal(f"job {job_id} is {row.status}; cancel it, or remove it when it is final")
    if not api.jobs.dismiss(job_id, row.status):
        return dismiss(job_id, api, caller, cancel)  # its status changed meanwhile; decide again
    return Response(status_code=204, headers=CANCELLED_BY_DELETE if cancel is None else {})


async def _wait(api: Api, row: JobRow, caller: Caller, seconds: int) -> JobRow:
    job_id = row.id
    deadline, version = time.monotonic() + seconds, 0
    async with api.watch.of(job_id, caller.tenant) as watched:
        while await watched.newer(version, max(0.0, deadline - time.monotonic())):
            version = watched.version
            if watched.row is None:
                raise JobNotFound(f"no job has the id {job_id!r}; it was removed meanwhile")
            row = watched.row
            if row.status.is_final:
                break
    return row


def _seconds_to_wait(prefer: str | None) -> int:
    match = re.search(r"(?:^|[,;\s])wait\s*=\s*(\d{1,9})", prefer or "")
    return min(int(match[1]), MAX_WAIT_S) if match else 0


def _check_successful(row: JobRow) -> None:
    if row.status is Status.DISMISSED:
        raise JobDismissed(f"job {row.id} was dismissed; start a new one")
    if row.status is not Status.SUCCESSFUL:
        why = (
            "failed; see its results"
            if row.status is Status.FAILED
            else f"{row.status}; poll it until it is final"
        )
        raise JobNotFinal(f"job {row.id} is {why}")


def _download(api: Api, request: Request, row: JobRow, name: str, *, inline: bool = False) -> Response:
    entry = next((entry for entry in row.files or [] if entry["name"] == name), None)
    if entry is None or row.published_attempt is None:
        raise FileNotInJob(f"job {row.id} has no file {name!r}; see /v1/jobs/{row.id}/files")
    etag = f'"{entry["sha256"]}"'
    if is_known(request, etag):
        return Response(status_code=304, headers={"ETag": etag})
    headers = {
        "Content-Length": str(entry["size"]),
        "ETag": etag,
        "Content-Digest": content_digest(entry["sha256"]),
    }
    if name == "report.html":  # shown in the browser, without scripts
        headers["Content-Security-Policy"] = REPORT_POLICY
    elif not inline:
        headers["Content-Disposition"] = f"attachment; filename*=UTF-8''{quote(name)}"
    content = api.blobs.read(row.id, row.published_attempt, name)
    return StreamingResponse(content, media_type=entry["media_type"], headers=headers)
