"""From a request to a stored batch."""

import hashlib
import json
from typing import Any

import structlog
from pydantic import ValidationError

from pipeline import Reference
from service.api.dependencies import Api
from service.api.intake import check_mesh, check_room, identity_of, queue_limits, with_design
from service.api.known_faces import check_faces
from service.api.webhook_options import check_webhook_url
from service.auth.keys import Caller
from service.contract.errors import IdempotencyMismatch, InvalidRequest, UnknownBlob
from service.contract.job_types import check_options
from service.contract.options import check_ceilings, invalid_request, parse_options, read_json
from service.contract.schemas import BatchRequest, BatchScan, BlobRef, Options, ProblemItem
from service.jobs.batches import BatchRow
from service.jobs.models import JobRow, new_id

log = structlog.get_logger()


def accept_batch(api: Api, caller: Caller, body: bytes, key: str | None) -> BatchRow:
    """Check a request, store the batch and its jobs."""
    given = read_json(body, "the body")
    if not isinstance(given, dict):
        raise InvalidRequest(
            "the body must be a JSON object", errors=[ProblemItem(pointer="", detail="must be a JSON object")]
        )
    sha256 = hashlib.sha256(json.dumps(given, sort_keys=True).encode()).hexdigest()
    options = parse_options(given.get("options", {}))
    check_options("registration", options)
    check_ceilings(options, api.settings.ceilings)
    try:
        request = BatchRequest.model_validate(given)
    except ValidationError as error:
        raise invalid_request(error, given, BatchRequest) from error
    if request.webhook is not None:
        check_webhook_url(request.webhook.url, "/webhook/url", api.guard)
    _check_meshes(api, caller, request)
    check_room(api, caller, key, count=len(request.scans))
    design = request.design.model_dump()
    options = with_design(api, caller, options, design)
    check_faces(api, caller.tenant, options, design)
    batch = BatchRow(
        id=new_id(),
        tenant=caller.tenant,
        label=request.label,
        webhook_url=request.webhook and request.webhook.url,
        total=len(request.scans),
    )
    shared = options.model_dump(mode="json")
    jobs = [_job(caller, number, design, each, options, shared) for number, each in enumerate(request.scans)]
    stored = api.jobs.add_batch(batch, jobs, key, sha256, queue_limits(api))
    if stored is None:
        raise IdempotencyMismatch(f"Idempotency-Key {key!r}: it was used for another request; use a new key")
    log.info("batch accepted", batch_id=stored.id, scans=stored.total, label=stored.label)
    return stored


def _check_meshes(api: Api, caller: Caller, request: BatchRequest) -> None:
    check_mesh(api, caller, request.design, "design")
    named = [each.scan.blob for each in request.scans if isinstance(each.scan, BlobRef)]
    stored = api.jobs.touch_blobs(sorted(set(named)), caller.tenant)
    for number, each in enumerate(request.scans):
        where = f"scans/{number}/scan"
        if not isinstance(each.scan, BlobRef):
            check_mesh(api, caller, each.scan, where)
        elif each.scan.blob not in stored:
            raise UnknownBlob(
                f"{where}: no blob {each.scan.blob} is stored; send it by PUT /v1/blobs first",
                errors=[ProblemItem(pointer=f"/{where}/blob", detail="not stored")],
            )


def _job(
    caller: Caller,
    number: int,
    design: dict[str, Any],
    scan: BatchScan,
    options: Options,
    shared: dict[str, Any],
) -> JobRow:
    reference = _merged(options.reference, scan.reference)
    label = options.label if scan.label is None else scan.label
    own = {"reference": reference and reference.model_dump(mode="json"), "label": label}
    return JobRow(
        id=new_id(),
        tenant=caller.tenant,
        type="registration",
        inputs={"design": design, "scan": scan.scan.model_dump()},
        options=shared | own,
        label=label,
        **identity_of(reference),
        batch_index=number,
    )


def _merged(shared: Reference | None, own: Reference | None) -> Reference | None:
    if shared is None or own is None:
        return own or shared
    keys = shared.model_dump(exclude_none=True) | own.model_dump(exclude_none=True)
    return Reference.model_validate(keys | {"more": shared.more | own.more})
