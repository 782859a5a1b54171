"""Free space, looked at while a body arrives: no length need be announced, and others arrive beside it."""

from collections.abc import Callable

from fastapi.concurrency import run_in_threadpool
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from service.api.storage_room import CHECK_BYTES


class DiskRoom:
    """ASGI middleware. check : raises what the client is told when there is no room"""

    def __init__(self, app: ASGIApp, check: Callable[[], None]) -> None:
        self._app, self._check = app, check

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass on, and look."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        received = looked_at = 0

        async def receive_looking() -> Message:
            nonlocal received, looked_at
            message = await receive()
            received += len(message.get("body", b""))
            if received - looked_at >= CHECK_BYTES:
                looked_at = received
                await run_in_threadpool(self._check)
            return message

        await self._app(scope, receive_looking, send)
