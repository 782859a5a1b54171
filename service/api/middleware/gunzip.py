"""Bodies with `Content-Encoding: gzip`, decompressed as they arrive, up to the limit of a request body."""

import hashlib
import zlib

from starlette.types import ASGIApp, Message, Receive, Scope, Send

from service.api import digests
from service.api.problems import problem_response
from service.contract.errors import BadRequest, PayloadTooLarge, UnsupportedMediaType, problem_of

CHUNK_BYTES = 256 * 1024  # decompressed at a time: limits the memory that a gzip bomb can use
_GZIP = 16 + zlib.MAX_WBITS
_DROPPED = (b"content-encoding", b"content-length", b"content-digest")


class Gunzip:
    """ASGI middleware: the application gets the plain body. `Content-Digest` of the compressed bytes is
    checked here.
    """

    def __init__(self, app: ASGIApp, max_bytes: int) -> None:
        self._app = app
        self._max_bytes = max_bytes

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Decompress, pass on, or refuse."""
        headers = dict(scope["headers"]) if scope["type"] == "http" else {}
        encoding = headers.get(b"content-encoding", b"identity").decode("latin-1").strip().lower()
        if encoding in ("identity", ""):
            await self._app(scope, receive, send)
            return
        if encoding not in ("gzip", "x-gzip"):
            refusal = UnsupportedMediaType(f"Content-Encoding {encoding!r}: send gzip, or the body as it is")
            await problem_response(problem_of(refusal), {"Connection": "close"})(scope, receive, send)
            return
        kept = [(name, value) for name, value in scope["headers"] if name not in _DROPPED]
        announced = headers.get(b"content-digest")
        body = _Unpacked(receive, self._max_bytes, None if announced is None else announced.decode("latin-1"))
        await self._app({**scope, "headers": kept}, body.receive, send)


class _Unpacked:
    """One body. Holds one received piece and one decompressed chunk in memory."""

    def __init__(self, receive: Receive, max_bytes: int, digest: str | None) -> None:
        self._receive, self._max_bytes, self._digest = receive, max_bytes, digest
        self._unpacker = zlib.decompressobj(_GZIP)
        self._packed = b""  # received, not yet unpacked
        self._is_last = False
        self._hash = hashlib.sha256()
        self._size = 0
        self._is_done = False

    async def receive(self) -> Message:
        """The next piece of the plain body."""
        if self._is_done:
            return await self._receive()  # the disconnect
        while not self._packed and not self._is_last:
            message = await self._receive()
            if message["type"] != "http.request":
                return message
            self._packed = message.get("body", b"")
            self._is_last = not message.get("more_body", False)
            self._hash.update(self._packed)
        plain = self._unpack()
        self._size += len(plain)
        if self._size > self._max_bytes:
            raise PayloadTooLarge(
                f"the decompressed request is larger than the limit of {self._max_bytes // 2**20} MiB; "
                "decimate the meshes, or raise CUSP_MAX_UPLOAD_MIB"
            )
        self._is_done = self._is_last and not self._packed and not self._unpacker.unconsumed_tail
        if self._is_done:
            if not self._unpacker.eof:
                raise BadRequest("the gzip body is truncated; send it again")
            digests.check(self._digest, self._hash.hexdigest())
        return {"type": "http.request", "body": plain, "more_body": not self._is_done}

    def _unpack(self) -> bytes:
        if self._unpacker.eof and self._packed:
            self._unpacker = zlib.decompressobj(_GZIP)  # gzip members may be concatenated
        try:
            plain = self._unpacker.decompress(self._packed, CHUNK_BYTES)
        except zlib.error as error:
            raise BadRequest(f"the body is not gzip, though Content-Encoding says so: {error}") from error
        self._packed = self._unpacker.unconsumed_tail or self._unpacker.unused_data
        return plain
