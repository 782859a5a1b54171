"""Each request has an id: the client's `X-Request-Id`, or a new one.

It is in the answer and in every log line about the request, so a client can quote it.
"""

import re
import time

import structlog
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from service.jobs.models import new_id

REQUEST_ID = re.compile(rb"[\x21-\x7e]{1,100}")
log = structlog.get_logger()


class RequestLog:
    """The outermost ASGI middleware. Logs one line per request: successful reads as `debug`, others as
    `info`.
    """

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Bind the id, pass on, log the status."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        sent = dict(scope["headers"]).get(b"x-request-id", b"")
        request_id = sent if REQUEST_ID.fullmatch(sent) else new_id().encode()
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
