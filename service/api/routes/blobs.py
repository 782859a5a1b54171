"""Meshes that clients send once and use in many jobs."""

from typing import Annotated

from fastapi import APIRouter, Path, Query, Request, Response

from service.api.dependencies import UseApi
from service.api.identity import Reads, Writes
from service.api.intake import accept_blob
from service.api.problems import problems
from service.contract.errors import NotFound
from service.contract.schemas import Blob

router = APIRouter(prefix="/v1/blobs", tags=["blobs"])

RAW_BODY = {
    "requestBody": {
        "required": True,
        "content": {"application/octet-stream": {"schema": {"type": "string", "format": "binary"}}},
    }
}


@router.put("", responses=problems(400, 401, 403, 413, 415, 422, 429, 507), openapi_extra=RAW_BODY)
async def put_blob(
    request: Request,
    api: UseApi,
    caller: Writes,
    filename: Annotated[str | None, Query(max_length=255, description="used to detect the format")] = None,
) -> Blob:
    """Store a mesh under its content. The same content again is the same blob."""
    return await accept_blob(request, api, caller, filename)


@router.head(
    "/{blob_id}", responses={200: {"description": "The blob is stored."}, **problems(401, 403, 404, 429)}
)
def head_blob(
    blob_id: Annotated[str, Path(description="`id` of the blob")], api: UseApi, caller: Reads
) -> Response:
    """Ask whether a blob is stored, before sending it."""
    row = api.jobs.blob(blob_id, caller.tenant)
    if row is None or not api.blobs.has(blob_id):
        raise NotFound(f"no blob {blob_id[:80]!r} is stored; send it by PUT /v1/blobs")
    return Response(
        headers={"ETag": f'"{blob_id}"', "X-Blob-Size": str(row.size), "X-Blob-Format": row.format}
    )
