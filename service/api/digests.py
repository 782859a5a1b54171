"""`Content-Digest` (RFC 9530) of requests and responses. Only the algorithm sha-256 is used."""

import base64
import hashlib
import re

from starlette.types import ASGIApp, Message, Receive, Scope, Send

from service.contract.errors import BadRequest, DigestMismatch

_SHA256 = re.compile(r"(?:^|,)\s*sha-256\s*=\s*:([^:]*):", re.IGNORECASE)


def content_digest(sha256: str) -> str:
    """The header's value. sha256 : hex"""
    return f"sha-256=:{base64.b64encode(bytes.fromhex(sha256)).decode()}:"


def check(header: str | None, sha256: str) -> None:
    """Compare the digest that the client announced, if any, with that of the received content.

    Raises
    ------
    BadRequest, DigestMismatch
    """
    match = _SHA256.search(header or "")
    if match is None:
        return
    try:
        announced = base64.b64decode(match[1], validate=True)
    except ValueError as error:  # also if it is not ASCII
        raise BadRequest("Content-Digest: sha-256 is not base64 between colons (RFC 9530)") from error
    if announced.hex() != sha256:
        raise DigestMismatch(
            f"Content-Digest announces sha-256 {announced.hex()[:16]}..., but the received content has "
            f"{sha256[:16]}...; send it again"
        )


class DigestCheck:
    """ASGI middleware: refuses a body that does not match its `Content-Digest`, when its end is read."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Hash the body if the request announces a digest."""
        announced = dict(scope["headers"]).get(b"content-digest") if scope["type"] == "http" else None
        if announced is None:
            await self._app(scope, receive, send)
            return
        seen = hashlib.sha256()

        async def receive_hashed() -> Message:
            message = await receive()
            if message["type"] == "http.request":
                seen.update(message.get("body", b""))
                if not message.get("more_body", False):
                    check(announced.decode("latin-1"), seen.hexdigest())
            return message

        await self._app(scope, receive_hashed, send)
