"""The limit of the size of a request body, enforced before and while it is read."""

from starlette.types import ASGIApp, Message, Receive, Scope, Send

from service.api.problems import problem_response
from service.contract.errors import PayloadTooLarge, problem_of


class BodyLimit:
    """ASGI middleware: checks Content-Length before the body is read, and counts the bytes that are read."""

    def __init__(self, app: ASGIApp, max_bytes: int) -> None:
        self._app = app
        self._max_bytes = max_bytes

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass on, or refuse."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        announced = dict(scope["headers"]).get(b"content-length", b"")
        if announced.isdigit() and int(announced) > self._max_bytes:
            # The rest of the body is not read, so the connection cannot be used again.
            await problem_response(problem_of(self._refusal()), {"Connection": "close"})(scope, receive, send)
            return
        await self._app(scope, self._counting(receive), send)

    def _counting(self, receive: Receive) -> Receive:
        received = 0

        async def receive_counted() -> Message:
            nonlocal received
            message = await receive()
            received += len(message.get("body", b""))
            if received > self._max_bytes:
                raise self._refusal()
            return message

        return receive_counted

    def _refusal(self) -> PayloadTooLarge:
        mib = self._max_bytes // 2**20
        return PayloadTooLarge(
            f"the request is larger than the limit of {mib} MiB; "
            "decimate the meshes, or raise CUSP_MAX_UPLOAD_MIB"
        )
