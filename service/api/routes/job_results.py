"""Results and files of a job."""

from typing import Annotated
from urllib.parse import quote

from fastapi import APIRouter, Path, Request, Response
from fastapi.responses import StreamingResponse

from service.api.dependencies import Api, UseApi
from service.api.digests import content_digest
from service.api.etags import NOT_CHANGED, is_known
from service.api.identity import Reads
from service.api.parameters import JobId
from service.api.problems import problem_response, problems
from service.contract.errors import FileNotInJob, JobDismissed, JobNotFinal
from service.contract.schemas import FileList, Results, Status
from service.jobs.models import JobRow
from service.jobs.views import files_of

FileName = Annotated[str, Path(description="as in the list of files", examples=["report.html"])]
REPORT_POLICY = (
    "default-src 'none'; img-src data:; style-src 'unsafe-inline'; sandbox; frame-ancestors 'none'"
)
router = APIRouter(prefix="/v1/jobs", tags=["jobs"])


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


def _check_successful(row: JobRow) -> None:
    if row.status is Status.DISMISSED:
        raise JobDismissed(f"job {row.id} was cancelled and has no results; start a new one")
    if row.status is not Status.SUCCESSFUL:
        why = (
            f"failed, so it has no files; GET /v1/jobs/{row.id}/results answers its error"
            if row.status is Status.FAILED
            else f"is {row.status}, so it has no results yet; poll GET /v1/jobs/{row.id} until it ends"
        )
        refused = JobNotFinal(f"job {row.id} {why}")
        if row.status.is_final:
            refused.retry_after_s = None  # it stays so: a client that tries again would do so for ever
        raise refused


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
