"""Jobs: start, list, cancel, remove."""

from typing import Annotated

import structlog
from fastapi import APIRouter, Query, Request, Response

from pipeline import Decision, VerdictStatus
from service.api.dependencies import UseApi
from service.api.identity import Reads, Writes
from service.api.intake import accept_job
from service.api.parameters import Cursor, JobId, idempotency_header
from service.api.problems import problems
from service.api.request_bodies import JOB_BODY
from service.api.routes.job_status import RETRY_AFTER_S
from service.contract.errors import JobFinal, JobNotFinal, JobNotFound
from service.contract.schemas import NO_NUL, Job, JobPage, JobType, Status
from service.jobs.models import JobRow
from service.jobs.views import job_of

ReferenceText = Annotated[
    str | None,
    Query(max_length=100, pattern=NO_NUL, description="select by this value of `options.reference`"),
]
#: Of a DELETE that cancels without `cancel=true`: deprecated (RFC 9745) since 2026-11-27, removed in 0.3.
CANCELLED_BY_DELETE = {
    "Deprecation": "@1795737600",
    "Link": '</docs#/jobs>; rel="deprecation"; type="text/html"',
}
router = APIRouter(prefix="/v1/jobs", tags=["jobs"])
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
        str | None, idempotency_header("with the same meshes and options it gives the same job")
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
    cursor: Cursor = None,
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


@router.post("/{job_id}/cancel", responses=problems(401, 403, 404, 409, 429))
def cancel(job_id: JobId, api: UseApi, caller: Writes) -> Job:
    """Cancel a waiting or running job. Never removes results: 409 if the job has ended meanwhile.

    To cancel a job that is dismissed already does nothing.
    """
    row = api.job(job_id, caller)
    if row.status.is_final and row.status is not Status.DISMISSED:
        raise JobFinal(
            f"job {job_id} is {row.status} already, so there is nothing to cancel; to remove it: DELETE "
            f"/v1/jobs/{job_id}"
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
        raise JobNotFound(
            f"no job has the id {job_id!r}: check the id and the API key; ended jobs are removed after "
            "some time"
        )
    if row.status.is_final:
        api.jobs.remove(job_id)
        api.blobs.remove_results(job_id)  # on each call: an earlier one may have been interrupted
        return Response(status_code=204)
    if cancel is False:
        raise JobNotFinal(
            f"job {job_id} is {row.status}, and only an ended job can be removed; send "
            "cancel=true to cancel it, or wait for its end"
        )
    if not api.jobs.dismiss(job_id, row.status):
        return dismiss(job_id, api, caller, cancel)  # its status changed meanwhile; decide again
    return Response(status_code=204, headers=CANCELLED_BY_DELETE if cancel is None else {})
