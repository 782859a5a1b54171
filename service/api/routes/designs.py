"""What is kept with a design for all its scans: named regions, limits, alignment."""

from typing import Annotated, Any

from fastapi import APIRouter, Header, Path, Query, Request, Response
from fastapi.concurrency import run_in_threadpool
from pydantic import ValidationError

from pipeline import Characteristics
from service.api.dependencies import Api, UseApi
from service.api.etags import is_known
from service.api.identity import Reads, Writes
from service.api.intake import json_body
from service.api.problems import problems
from service.auth.keys import Caller
from service.contract.errors import NoCharacteristics, PreconditionFailed, UnknownBlob
from service.contract.options import invalid_request, read_json
from service.jobs.characteristics import ANY, CharacteristicsRow

DesignId = Annotated[
    str,
    Path(
        description="`id` of the design's blob",
        pattern=r"^sha256:[0-9a-f]{64}$",
        examples=["sha256:697b00ab13410c52a542d2e9c63711fcc04e9cbf6c0d3439a9b43cc812e6e713"],
    ),
]
IfMatch = Annotated[
    str | None,
    Header(max_length=200, description="only if this is the ETag of what is stored; `*`: if there is any"),
]
IfNoneMatch = Annotated[
    str | None, Header(max_length=200, description="`*`: only if there is none yet (PUT); known ETag (GET)")
]
BODY: dict[str, Any] = {
    "requestBody": {
        "required": True,
        "content": {"application/json": {"schema": {"$ref": "#/components/schemas/Characteristics"}}},
    }
}
router = APIRouter(prefix="/v1/designs", tags=["designs"])


@router.put(
    "/{blob}/characteristics",
    responses={
        201: {"description": "They were created.", "model": Characteristics},
        **problems(400, 401, 403, 412, 413, 422, 429),
    },
    response_model=Characteristics,
    openapi_extra=BODY,
)
async def put_characteristics(
    blob: DesignId,
    request: Request,
    api: UseApi,
    caller: Writes,
    if_match: IfMatch = None,
    if_none_match: IfNoneMatch = None,
) -> Response:
    """Keep named regions, limits and an alignment with a design; each later job on it uses what its own
    options do not state.
    """
    document = read_json(await json_body(request), "the body")
    try:
        given = Characteristics.model_validate(document)
    except ValidationError as error:
        raise invalid_request(error, document, Characteristics) from error
    return await run_in_threadpool(_put, api, caller, blob, given, if_match, if_none_match)


def _put(
    api: Api,
    caller: Caller,
    blob: str,
    given: Characteristics,
    if_match: str | None,
    if_none_match: str | None,
) -> Response:
    if api.jobs.blob(blob, caller.tenant) is None:
        raise UnknownBlob(f"design: no blob {blob} is stored; send it by PUT /v1/blobs first")
    before = api.jobs.characteristics(blob, caller.tenant)
    row = None
    if if_none_match is not None and if_none_match.strip() == ANY:
        row = api.jobs.put_characteristics(blob, caller.tenant, given, expected=None)
    elif if_match is None:
        row = api.jobs.put_characteristics(blob, caller.tenant, given)
    elif before is not None and (if_match.strip() == ANY or _etag(before) in _tags(if_match)):
        row = api.jobs.put_characteristics(blob, caller.tenant, given, expected=before.version)
    if row is None:
        found = (
            "is another version than If-Match names" if if_match else "is there already (If-None-Match: *)"
        )
        raise PreconditionFailed(f"what is kept with {blob} {found}; get it, and repeat the change")
    return _answer(row, 201 if before is None else 200)


@router.get(
    "/{blob}/characteristics",
    response_model=Characteristics,
    responses={304: {"description": "Not changed since If-None-Match."}, **problems(401, 403, 404, 422, 429)},
)
def get_characteristics(
    blob: DesignId,
    request: Request,
    api: UseApi,
    caller: Reads,
    if_none_match: IfNoneMatch = None,
    empty: Annotated[
        bool, Query(description="where nothing is kept, answer an empty document instead of 404")
    ] = False,
) -> Response:
    """Get what is kept with a design. The ETag changes with the content."""
    row = api.jobs.characteristics(blob, caller.tenant)
    if row is None and empty:
        return Response(Characteristics().model_dump_json(), media_type="application/json")
    if row is None:
        raise NoCharacteristics(f"the design {blob} has no characteristics; store them here by PUT")
    if if_none_match is not None and is_known(request, _etag(row)):
        return Response(status_code=304, headers={"ETag": _etag(row)})
    return _answer(row, 200)


@router.delete(
    "/{blob}/characteristics",
    status_code=204,
    response_class=Response,
    responses=problems(401, 403, 404, 422, 429),
)
def delete_characteristics(blob: DesignId, api: UseApi, caller: Writes) -> Response:
    """Forget what is kept with a design. Jobs that were sent before keep theirs."""
    if not api.jobs.delete_characteristics(blob, caller.tenant):
        raise NoCharacteristics(f"the design {blob} has no characteristics")
    return Response(status_code=204)


def _etag(row: CharacteristicsRow) -> str:
    return f'"{row.version}"'


def _tags(header: str) -> list[str]:
    return [tag.strip() for tag in header.split(",")]


def _answer(row: CharacteristicsRow, status: int) -> Response:
    return Response(
        Characteristics.model_validate(row.document).model_dump_json(),
        status_code=status,
        media_type="application/json",
        headers={"ETag": _etag(row), "Cache-Control": "no-cache"},
    )
