"""Batches: many scans of one design at once."""

import csv
import io
from collections.abc import Iterator
from typing import Annotated, Any

from fastapi import APIRouter, Path, Query, Request, Response
from fastapi.concurrency import run_in_threadpool
from fastapi.responses import StreamingResponse

from pipeline import Reference
from service.api.batch_intake import accept_batch
from service.api.dependencies import Api, UseApi
from service.api.etags import NOT_CHANGED, conditional_json
from service.api.identity import Reads, Writes
from service.api.intake import check_room, json_body
from service.api.parameters import Cursor, idempotency_header
from service.api.problems import problems
from service.auth.keys import Caller
from service.contract.errors import BatchNotFound, UnsupportedMediaType
from service.contract.schemas import NO_NUL, Batch, BatchPage, DeliveryList
from service.jobs.batches import BatchRow
from service.jobs.models import JobRow
from service.jobs.views import time_of
from service.webhooks.outbox import delivery_list

BatchId = Annotated[
    str, Path(description="`id` of the batch", examples=["01a2019a-6685-7220-8c73-80d9802cf568"])
]
BODY: dict[str, Any] = {
    "requestBody": {
        "required": True,
        "content": {"application/json": {"schema": {"$ref": "#/components/schemas/BatchRequest"}}},
    }
}
REFERENCE_COLUMNS = [name for name in Reference.model_fields if name != "more"]
COLUMNS = (
    *("index", "job", "label", *REFERENCE_COLUMNS),
    *("status", "verdict", "decision", "error", "created", "finished"),
)
#: Of a request: 1,000 scans with the longest addresses and references.
MAX_BATCH_BYTES = 8 * 1024 * 1024
router = APIRouter(prefix="/v1/batches", tags=["batches"])


@router.post(
    "",
    status_code=202,
    responses=problems(400, 401, 403, 413, 415, 422, 429, 503, 507),
    openapi_extra=BODY,
)
async def submit_batch(
    request: Request,
    response: Response,
    api: UseApi,
    caller: Writes,
    idempotency_key: Annotated[
        str | None, idempotency_header("the same request with it gives the same batch")
    ] = None,
) -> Batch:
    """Start a job for each of up to 1,000 scans of one design, all or none."""
    kind = request.headers.get("content-type", "").partition(";")[0].strip().lower()
    if kind != "application/json":
        raise UnsupportedMediaType(f"Content-Type {kind!r}: send application/json")
    row = await run_in_threadpool(
        accept_batch, api, caller, await json_body(request, MAX_BATCH_BYTES), idempotency_key
    )
    response.headers["Location"] = f"/v1/batches/{row.id}"
    return await run_in_threadpool(api.jobs.batch_document, row)


@router.get("", responses=problems(401, 403, 422, 429))
def list_batches(
    api: UseApi,
    caller: Reads,
    label: Annotated[
        str | None, Query(max_length=200, pattern=NO_NUL, description="select by this value")
    ] = None,
    limit: Annotated[int, Query(ge=1, le=100, description="batches on a page")] = 20,
    cursor: Cursor = None,
) -> BatchPage:
    """List batches, newest first."""
    rows, after = api.jobs.batches(caller.tenant, label, cursor, limit)
    return BatchPage(batches=[api.jobs.batch_document(row) for row in rows], next=after)


@router.get(
    "/{batch_id}",
    response_model=Batch,
    responses={**NOT_CHANGED, **problems(401, 403, 404, 429)},
)
def batch_status(batch_id: BatchId, request: Request, api: UseApi, caller: Reads) -> Response:
    """Get the state of a batch: how many of its jobs have which status, verdict and decision."""
    document = api.jobs.batch_document(_existing(api, caller, batch_id))
    return conditional_json(request, document.model_dump_json(), {})


@router.get(
    "/{batch_id}/table.csv",
    response_class=StreamingResponse,
    responses={
        200: {"content": {"text/csv": {"schema": {"type": "string"}}}},
        **problems(401, 403, 404, 429),
    },
)
def table(batch_id: BatchId, api: UseApi, caller: Reads) -> StreamingResponse:
    """Get a row for each scan: which part, what became of its job, verdict and decision."""
    rows = api.jobs.jobs_of_batch(_existing(api, caller, batch_id).id)
    return StreamingResponse(
        _csv(rows),
        media_type="text/csv",
        headers={"Content-Disposition": f"attachment; filename=batch-{batch_id[:36]}.csv"},
    )


@router.get("/{batch_id}/deliveries", responses=problems(401, 403, 404, 429))
def batch_deliveries(batch_id: BatchId, api: UseApi, caller: Reads) -> DeliveryList:
    """List the message to the webhook of a batch, with its delivery attempts."""
    return delivery_list(api.deliveries.of_job(_existing(api, caller, batch_id).id))


@router.post("/{batch_id}/cancel", responses=problems(401, 403, 404, 429))
def cancel_batch(batch_id: BatchId, api: UseApi, caller: Writes) -> Batch:
    """Cancel every job of a batch that has not ended; results are kept."""
    row = _existing(api, caller, batch_id)
    api.jobs.dismiss_batch(row.id)
    return api.jobs.batch_document(_existing(api, caller, batch_id))


@router.post("/{batch_id}/retry", status_code=202, responses=problems(401, 403, 404, 429, 503, 507))
def retry_batch(batch_id: BatchId, api: UseApi, caller: Writes) -> Batch:
    """Start a new job for each scan whose job failed. The failed jobs leave the batch; they can still be
    read.
    """
    row = _existing(api, caller, batch_id)
    if failed := api.jobs.count_failed(row.id):
        check_room(api, caller, None, count=failed)
        api.jobs.retry_failed(row.id)
    return api.jobs.batch_document(_existing(api, caller, batch_id))


def _existing(api: Api, caller: Caller, batch_id: str) -> BatchRow:
    row = api.jobs.batch(batch_id, caller.tenant)
    if row is None:
        raise BatchNotFound(f"no batch has the id {batch_id[:80]!r}; see /v1/batches")
    return row


def _csv(rows: Any) -> Iterator[str]:
    yield _line(COLUMNS)
    for row in rows:
        yield _line(_cells(row))


def _cells(row: JobRow) -> list[object]:
    is_removed = row.removed_ms is not None  # its identity is forgotten
    reference = {} if is_removed else row.options.get("reference") or {}
    times = (time_of(row.created_ms), time_of(row.finished_ms))
    return [
        *(row.batch_index, row.id, row.label),
        *(reference.get(name) for name in REFERENCE_COLUMNS),
        "removed" if is_removed else row.status.value,
        *(row.verdict, row.decision, row.error and row.error["code"]),
        *(each and each.isoformat() for each in times),
    ]


def _line(cells: Any) -> str:
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerow(cells)
    return text.getvalue()
