"""Strong ETags: a polling client gets an empty 304 if nothing changed."""

import hashlib
from collections.abc import Mapping
from typing import Any

from fastapi import Request, Response

#: For `responses` of a route.
NOT_CHANGED: dict[int | str, dict[str, Any]] = {304: {"description": "Not changed since If-None-Match."}}


def is_known(request: Request, etag: str) -> bool:
    """True if the client has this version, by `If-None-Match`."""
    known = [tag.strip().removeprefix("W/") for tag in request.headers.get("if-none-match", "").split(",")]
    return etag in known or "*" in known


def conditional_json(request: Request, body: str, headers: Mapping[str, str]) -> Response:
    """`body` with its ETag, or 304 if the client has this version."""
    etag = f'"{hashlib.sha256(body.encode()).hexdigest()[:32]}"'
    all_headers = {**headers, "ETag": etag, "Cache-Control": "no-cache"}
    if is_known(request, etag):
        return Response(status_code=304, headers=all_headers)
    return Response(body, media_type="application/json", headers=all_headers)
