"""The state of a job: at once, when it is final (long poll), whenever it changes (events)."""

import re
import time
from collections.abc import AsyncIterator
from typing import Annotated

from fastapi import APIRouter, Header, Request, Response
from fastapi.responses import StreamingResponse
from fastapi.sse import KEEPALIVE_COMMENT, format_sse_event

from service.api.dependencies import Api, UseApi
from service.api.etags import NOT_CHANGED, conditional_json
from service.api.identity import Reads
from service.api.job_watch import PING_INTERVAL_S
from service.api.parameters import JobId
from service.api.problems import problems
from service.auth.keys import Caller
from service.contract.errors import JobNotFound
from service.contract.schemas import Job, JobForecast, Options
from service.jobs.models import JobRow
from service.jobs.views import forecast_of, job_of, options_of

RETRY_AFTER_S = 1
MAX_WAIT_S = 60
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
router = APIRouter(prefix="/v1/jobs", tags=["jobs"])


class EventStream(StreamingResponse):
    """Events that are encoded once for all that watch a job; FastAPI's own class encodes them for each."""

    media_type = "text/event-stream"

    def __init__(self, events: AsyncIterator[bytes]) -> None:
        super().__init__(events, headers={"Cache-Control": "no-cache", "X-Accel-Buffering": "no"})


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


@router.get("/{job_id}/options", response_model=Options, responses=problems(401, 403, 404, 429))
def options(job_id: JobId, api: UseApi, caller: Reads) -> Options:
    """Get what was asked of a job, completed by what was kept with its design when it was sent."""
    return options_of(api.job(job_id, caller))


async def _wait(api: Api, row: JobRow, caller: Caller, seconds: int) -> JobRow:
    job_id = row.id
    deadline, version = time.monotonic() + seconds, 0
    async with api.watch.of(job_id, caller.tenant) as watched:
        while await watched.newer(version, max(0.0, deadline - time.monotonic())):
            version = watched.version
            if watched.row is None:
                raise JobNotFound(f"no job has the id {job_id!r}; it was removed while you waited")
            row = watched.row
            if row.status.is_final:
                break
    return row


def _seconds_to_wait(prefer: str | None) -> int:
    match = re.search(r"(?:^|[,;\s])wait\s*=\s*(\d{1,9})", prefer or "")
    return min(int(match[1]), MAX_WAIT_S) if match else 0
