"""From a request to a stored job. Only the first bytes of a file are read here, to detect its format.

The file is parsed in the process of the job only.
"""

import hashlib
import json
from collections import Counter
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any

import structlog
from fastapi import Request
from fastapi.concurrency import run_in_threadpool
from pydantic import ValidationError
from starlette.datastructures import FormData, UploadFile

from pipeline import Characteristics, Reference, detect_format
from service.api.dependencies import Api
from service.api.known_faces import check_faces
from service.api.storage_room import CHECK_BYTES, check_disk, check_quota
from service.api.webhook_options import check_webhook
from service.auth.keys import Caller
from service.contract.design_options import completed, known_blob
from service.contract.errors import (
    IdempotencyMismatch,
    InvalidRequest,
    PayloadTooLarge,
    UnknownBlob,
    UnsupportedMediaType,
)
from service.contract.job_types import ALL_MESHES, MESHES, check_meshes, check_options, parse_type, wrong_part
from service.contract.options import check_ceilings, invalid_request, parse_options, read_json
from service.contract.schemas import (
    Blob,
    JobRequest,
    JobType,
    LandmarksRequest,
    MeshRef,
    Options,
    ProblemItem,
    RegistrationRequest,
    Status,
    StudyRequest,
    UrlRef,
)
from service.jobs.admission import QueueLimits
from service.jobs.models import JobRow, new_id
from service.storage.blobs import Upload
from service.webhooks.address_guard import ForbiddenAddress

REQUESTS: dict[JobType, type[JobRequest]] = {
    "registration": RegistrationRequest,
    "landmarks": LandmarksRequest,
    "study": StudyRequest,
}
MAX_TEXT_BYTES = 1024 * 1024  # of a JSON body, or of a text part of a form
log = structlog.get_logger()


@dataclass(frozen=True, slots=True)
class Source:
    """A mesh file of a form."""

    name: str
    file: IO[bytes]
    filename: str | None
    size: int  # bytes


@dataclass(frozen=True, slots=True)
class Submission:
    """A validated request for a job. inputs : mesh name -> blob and filename"""

    job_type: JobType
    inputs: dict[str, Any]
    options: Options
    sent_options: Any  # as the client sent them, without defaults: those may change with the version

    def sha256(self) -> str:
        """Hash of the content of the meshes, their file name suffixes, the type and the options as sent."""
        meshes = {
            name: [each.get("blob") or each["url"], Path(each["filename"] or "").suffix]
            for name, each in self.inputs.items()
        }
        parts = [self.job_type, meshes, self.sent_options]
        return hashlib.sha256(json.dumps(parts, sort_keys=True).encode()).hexdigest()


async def accept_job(request: Request, api: Api, caller: Caller, key: str | None) -> JobRow:
    """Read a multipart or JSON request, store the job, queue it. key : the client's `Idempotency-Key`"""
    kind = request.headers.get("content-type", "").partition(";")[0].strip().lower()
    if kind == "multipart/form-data":
        size = _announced_bytes(request)
        await run_in_threadpool(check_disk, api, size)  # before the form is read
        async with request.form(max_files=8, max_fields=16, max_part_size=MAX_TEXT_BYTES) as form:
            submission = await run_in_threadpool(_from_form, api, caller, form, key, size)
    elif kind == "application/json":
        submission = await run_in_threadpool(_from_json, api, caller, await json_body(request), key)
    else:
        raise UnsupportedMediaType(
            f"Content-Type {kind!r}: send the files as multipart/form-data (with curl: -F design=@FILE "
            "-F scan=@FILE), "
            "or a JSON body as application/json"
        )
    return await run_in_threadpool(_store, api, caller, key, submission)


async def accept_blob(request: Request, api: Api, caller: Caller, filename: str | None) -> Blob:
    """Stream a request's body into a blob."""
    size = _announced_bytes(request)
    await run_in_threadpool(check_disk, api, size)
    await run_in_threadpool(check_quota, api, caller, size)
    writer = await run_in_threadpool(api.blobs.writer)
    with api.arriving.upload(caller.tenant) as arriving:
        try:
            checked = 0
            async for chunk in request.stream():
                if chunk:
                    arriving.grow(len(chunk))
                    await run_in_threadpool(writer.write, chunk)
                    if arriving.size - checked >= CHECK_BYTES:
                        checked = arriving.size
                        await run_in_threadpool(check_quota, api, caller, 0)
            await run_in_threadpool(check_quota, api, caller, 0)  # no length need be announced
            upload = await run_in_threadpool(writer.finish)
        except BaseException:
            await run_in_threadpool(writer.abort)
            raise
        return (await run_in_threadpool(_keep, api, caller, {"blob": (upload, filename)}))["blob"]


def _announced_bytes(request: Request) -> int:
    """`Content-Length`; 0 where it is not sent, or not a number."""
    given = request.headers.get("content-length", "")
    return int(given) if given.isascii() and given.isdecimal() else 0


def _from_form(api: Api, caller: Caller, form: FormData, key: str | None, size: int) -> Submission:
    job_type = parse_type(_text(form, "type", "registration"))
    given = sorted({name for name, _ in form.multi_items()})
    check_meshes(job_type, given)
    known = (*MESHES[job_type], "type", "options")
    for name in given:
        if name not in known:
            raise wrong_part(name, f"unknown part of the form; a {job_type} job takes {', '.join(known)}")
    sent = read_json(_text(form, "options", "{}"), "options")
    options = parse_options(sent)
    check_options(job_type, options)
    check_ceilings(options, api.settings.ceilings)
    check_webhook(options, api.guard)
    sources = [_source(form, name) for name in MESHES[job_type]]
    with api.arriving.upload(caller.tenant) as arriving:
        arriving.grow(max(size, sum(source.size for source in sources)))
        check_room(api, caller, key)
        blobs = _keep(api, caller, _received(api, sources))
    inputs = {source.name: {"blob": blobs[source.name].id, "filename": source.filename} for source in sources}
    return Submission(job_type, inputs, options, sent)


def _from_json(api: Api, caller: Caller, body: bytes, key: str | None) -> Submission:
    given = read_json(body, "the body")
    if not isinstance(given, dict):
        raise InvalidRequest(
            "the body must be a JSON object", errors=[ProblemItem(pointer="", detail="must be a JSON object")]
        )
    job_type = parse_type(given.get("type", "registration"))
    check_meshes(job_type, given)
    sent = given.pop("options", {})
    sent = read_json(sent, "options") if isinstance(sent, str) else sent
    options = parse_options(sent)
    check_options(job_type, options)
    check_ceilings(options, api.settings.ceilings)
    check_webhook(options, api.guard)
    try:
        job = REQUESTS[job_type].model_validate(given)
    except ValidationError as error:
        raise invalid_request(error, given, REQUESTS[job_type]) from error
    inputs: dict[str, MeshRef] = {name: getattr(job, name) for name in MESHES[job_type]}
    for name, ref in inputs.items():
        check_mesh(api, caller, ref, name)
    check_room(api, caller, key)
    return Submission(job_type, {name: ref.model_dump() for name, ref in inputs.items()}, options, sent)


def check_mesh(api: Api, caller: Caller, ref: MeshRef, where: str) -> None:
    """A blob must be stored, and an address one that meshes may be fetched from. where : path in the request

    Raises
    ------
    UnknownBlob, InvalidRequest
    """
    if isinstance(ref, UrlRef):
        try:
            api.mesh_guard.check_url(ref.url)
        except ForbiddenAddress as error:
            item = ProblemItem(pointer=f"/{where}/url", detail=str(error)[:300])
            raise InvalidRequest(f"{where}: url: {error}", errors=[item]) from error
    elif not api.jobs.touch_blob(ref.blob, caller.tenant) or not api.blobs.has(ref.blob):
        raise UnknownBlob(f"{where}: no blob {ref.blob} is stored; send it by PUT /v1/blobs first")


def _store(api: Api, caller: Caller, key: str | None, submission: Submission) -> JobRow:
    options = submission.options
    if submission.job_type == "registration" and not (key and api.jobs.knows_key(caller.tenant, key)):
        options = with_design(api, caller, options, submission.inputs["design"])
        check_faces(api, caller.tenant, options, submission.inputs["design"])
    row = JobRow(
        id=new_id(),
        tenant=caller.tenant,
        type=submission.job_type,
        inputs=submission.inputs,
        options=options.model_dump(mode="json"),
        label=submission.options.label,
        **identity_of(options.reference),
        attempt=0,
        crashes=0,
        progress=0.0,
    )
    if key is None:
        api.jobs.add(row, queue_limits(api))
    else:
        stored = api.jobs.add_once(row, key, submission.sha256(), queue_limits(api))
        if stored is None:
            raise IdempotencyMismatch(
                f"Idempotency-Key {key!r}: it was used for a job with other meshes or options; use a new key"
            )
        if stored.id != row.id:
            log.info("job known by its idempotency key", job_id=stored.id)
            return stored
    log.info("job accepted", job_id=row.id, type=row.type, label=row.label)
    return row


def with_design(api: Api, caller: Caller, options: Options, design: dict[str, Any]) -> Options:
    """The options completed by what the tenant keeps with the design. Of an address without a digest that is
    known only when it is fetched. Raises InvalidOptions.
    """
    blob = known_blob(design)
    if blob is None:
        return options
    row = api.jobs.characteristics(blob, caller.tenant)
    return completed(options, None if row is None else Characteristics.model_validate(row.document))


def identity_of(reference: Reference | None) -> dict[str, str | None]:
    """The columns that jobs are found by."""
    names = ("serial", "batch", "part_number")
    return {name: None if reference is None else getattr(reference, name) for name in names}


def _keep(api: Api, caller: Caller, uploads: dict[str, tuple[Upload, str | None]]) -> dict[str, Blob]:
    """Check each upload and store it under its content; if one is refused, none is stored."""
    try:
        formats = {
            name: detect_format(upload.head, upload.size, filename, mesh=name if name in ALL_MESHES else None)
            for name, (upload, filename) in uploads.items()
        }
    except BaseException:
        _discard(api, uploads)
        raise
    blobs, pending = {}, dict(uploads)
    try:
        for name, (upload, _) in uploads.items():
            api.blobs.keep(upload)
            del pending[name]
            api.jobs.add_blob(upload.blob_id, upload.size, formats[name].value, caller.tenant)
            blobs[name] = Blob(id=upload.blob_id, size=upload.size, format=formats[name].value)
    except BaseException:
        _discard(api, pending)
        raise
    counts, sizes = Counter[str](), Counter[str]()
    for blob in blobs.values():
        counts[blob.format] += 1
        sizes[blob.format] += blob.size
    api.metrics.add({"cusp_uploads": counts, "cusp_upload_bytes": sizes})
    return blobs


def _received(api: Api, sources: list[Source]) -> dict[str, tuple[Upload, str | None]]:
    uploads: dict[str, tuple[Upload, str | None]] = {}
    try:
        for source in sources:
            uploads[source.name] = (api.blobs.receive(source.file), source.filename)
    except BaseException:
        _discard(api, uploads)
        raise
    return uploads


def _discard(api: Api, uploads: dict[str, tuple[Upload, str | None]]) -> None:
    for upload, _ in uploads.values():
        with suppress(Exception):  # retention deletes it later; the first error is the one to report
            api.blobs.discard(upload)


def _source(form: FormData, name: str) -> Source:
    given = form.getlist(name)
    if len(given) != 1:
        raise wrong_part(
            name,
            f"missing; send it as a file of the form, with curl -F {name}=@FILE"
            if not given
            else "sent more than once; send one file",
        )
    if not isinstance(given[0], UploadFile):
        raise wrong_part(name, f"must be a file, not text; with curl put @ before its name: -F {name}=@FILE")
    return Source(name, given[0].file, given[0].filename or None, given[0].size or 0)


def _text(form: FormData, name: str, default: str) -> str:
    given = form.get(name, default)
    if isinstance(given, str):
        return given
    if given.size is not None and given.size > MAX_TEXT_BYTES:
        raise PayloadTooLarge(f"{name}: more than {MAX_TEXT_BYTES // 1024} KiB of text; send less")
    try:
        return given.file.read().decode()
    except UnicodeDecodeError as error:
        raise wrong_part(name, "must be UTF-8 text") from error


def check_room(api: Api, caller: Caller, key: str | None, count: int = 1) -> None:
    """Refuse a job beyond the queue limits or the quota. A repeated request starts none and is answered."""
    if key is not None and api.jobs.knows_key(caller.tenant, key):
        return
    check_quota(api, caller, 0)
    waiting = (api.jobs.count(Status.ACCEPTED, caller.tenant), api.jobs.count(Status.ACCEPTED))
    queue_limits(api).check(*(each + count for each in waiting))


def queue_limits(api: Api) -> QueueLimits:
    """Those of the settings."""
    return QueueLimits(api.settings.tenant_queue_limit, api.settings.queue_limit)


async def json_body(request: Request, max_bytes: int = MAX_TEXT_BYTES) -> bytes:
    """The body. Raises PayloadTooLarge."""
    body = b""
    async for chunk in request.stream():
        body += chunk
        if len(body) > max_bytes:
            raise PayloadTooLarge(
                f"a JSON body may have at most {max_bytes // 1024} KiB; send meshes by PUT /v1/blobs"
            )
    return body
