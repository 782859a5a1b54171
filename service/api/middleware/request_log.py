"""Each request has an id: the client's `X-Request-Id`, or one of ours. It is in every line of the log about the request, in
the answer, and so in what a client quotes when something went wrong.
"""

import re
import time

import structlog
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from service.jobs.models import new_id

GIVEN = re.compile(rb"[\x21-\x7e]{1,100}")
log = structlog.get_logger()


class RequestLog:
    """ASGI middleware, the outermost. One line a request: reads that went well are `debug`, all else is `info`."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Bind the id, pass on, tell how it went."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        given = dict(scope["headers"]).get(b"x-request-id", b"")
        request_id = given if GIVEN.fullmatch(given) else new_id().encode()
        status, begun = 0, time.monotonic()

        async def send_with_id(message: Message) -> None:
            nonlocal status
            if message["type"] == "http.response.start":
                status = message["status"]
                message["headers"] = [*message.get("headers", []), (b"x-request-id", request_id)]
            await send(message)

        structlog.contextvars.clear_contextvars()
        structlog.contextvars.bind_contextvars(request_id=request_id.decode("ascii"))
        try:
            await self._app(scope, receive, send_with_id)
        finally:
            is_plain = scope["method"] in ("GET", "HEAD") and 200 <= status < 400
            (log.debug if is_plain else log.info)(
                "request",
                method=scope["method"],
                path=scope["path"],
                status=status,
                seconds=round(time.monotonic() - begun, 4),
            )
