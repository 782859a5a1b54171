"""The container of a glTF 2.0: chunks of a GLB, or JSON alone, and its buffers.

Source: glTF 2.0 specification, sections 3.6.1 (buffers) and 4 (GLB).
"""

import base64
import binascii
import struct
from collections.abc import Callable
from dataclasses import dataclass, field

from pydantic import ValidationError

from pipeline.core.errors import TruncatedFile, UnreadableFile
from pipeline.core.formats import Format, as_utf8
from pipeline.stages.load.gltf_records import Document

MAGIC = b"glTF"
HEADER_BYTES, CHUNK_HEADER_BYTES = 12, 8
JSON_CHUNK, BINARY_CHUNK = b"JSON", b"BIN\0"
MESHOPT = ("EXT_meshopt_compression", "KHR_meshopt_compression")
UNCOMPRESSED = "export the GLB without compression (in gltfpack: without -c, -cc, -cz)"


@dataclass(slots=True, eq=False)
class Container:
    """document : the JSON; binary : the binary chunk of a GLB; outside : reads a file that the JSON refers
    to, by its URI, or None when it was not sent
    """

    document: Document
    binary: memoryview | None
    outside: Callable[[str], bytes | None] | None = None
    _buffers: dict[int, memoryview] = field(default_factory=dict)

    def buffer(self, index: int, where: str) -> memoryview:
        """Bytes of a buffer.

        Raises
        ------
        TruncatedFile, UnreadableFile
            When it is not in the file, or is shorter than announced.
        """
        if index not in self._buffers:
            self._buffers[index] = self._read(index, where)
        return self._buffers[index]

    def _read(self, index: int, where: str) -> memoryview:
        buffers = self.document.buffers
        if index >= len(buffers):
            raise UnreadableFile(
                f"{where} of the {Format.GLB} refers to buffer {index}, but there are {len(buffers)}"
            )
        buffer = buffers[index]
        for name in MESHOPT:
            if buffer.uri is None and name in buffer.extensions:
                raise UnreadableFile(
                    f"the meshes of the {Format.GLB} are compressed ({name}), which is not read",
                    remedy=UNCOMPRESSED,
                )
        if buffer.uri is not None:
            content = self._of_uri(buffer.uri, index)
        elif index == 0 and self.binary is not None:
            content = self.binary
        else:
            raise UnreadableFile(f"buffer {index} of the {Format.GLB} has no data: neither a chunk nor a URI")
        if len(content) < buffer.byteLength:
            raise TruncatedFile(
                f"buffer {index} of the {Format.GLB} announces {buffer.byteLength} bytes "
                f"and has {len(content)}"
            )
        return content

    def _of_uri(self, uri: str, index: int) -> memoryview:
        if uri.startswith("data:"):
            return _embedded(uri, index)
        content = None if self.outside is None else self.outside(uri)
        if content is None:
            raise UnreadableFile(
                f"buffer {index} of the glTF is in another file, {uri[:80]!r}, which was not sent",
                remedy="export the part as GLB, which is one file, or send the .gltf with its files in a zip",
            )
        return memoryview(content)


def _embedded(uri: str, index: int) -> memoryview:
    """The bytes of a data URI (RFC 2397)."""
    scheme, comma, payload = uri.partition(",")
    if not comma or not scheme.endswith(";base64"):
        raise UnreadableFile(f"buffer {index} of the glTF is embedded in another way than base64")
    try:
        return memoryview(base64.b64decode(payload, validate=True))
    except (binascii.Error, ValueError) as error:
        raise UnreadableFile(f"buffer {index} of the glTF is no valid base64 ({error})") from error


def open_container(data: bytes) -> Container:
    """The document and the binary chunk.

    Raises
    ------
    TruncatedFile, UnreadableFile
    """
    if not data.startswith(MAGIC):
        return Container(_document(data), None)
    if len(data) < HEADER_BYTES:
        raise TruncatedFile(f"the {Format.GLB} has {len(data)} bytes; its header alone has {HEADER_BYTES}")
    version, length = struct.unpack_from("<II", data, len(MAGIC))
    if version != 2:
        raise _other_version(str(version))
    if (
        length >= len(data) + CHUNK_HEADER_BYTES
    ):  # less is no chunk: padding that was counted, and not written
        raise TruncatedFile(f"the {Format.GLB} announces {length} bytes and has {len(data)}")
    length = min(length, len(data))
    json_chunk: bytes | None = None
    binary: memoryview | None = None
    position = HEADER_BYTES
    while position + CHUNK_HEADER_BYTES <= length:
        (size,) = struct.unpack_from("<I", data, position)
        kind = data[position + 4 : position + 8]
        start = position + CHUNK_HEADER_BYTES
        if start + size > len(data):
            raise TruncatedFile(
                f"the chunk at byte {position} of the {Format.GLB} announces {size} bytes "
                f"and has {len(data) - start}"
            )
        if json_chunk is None:
            if kind != JSON_CHUNK:
                raise UnreadableFile(f"the first chunk of the {Format.GLB} is not JSON, but {kind!r}")
            json_chunk = data[start : start + size]
        elif kind == BINARY_CHUNK and binary is None:
            binary = memoryview(data)[start : start + size]
        position = start + size
    if json_chunk is None:
        raise UnreadableFile(f"the {Format.GLB} has no chunk with its JSON")
    return Container(_document(json_chunk), binary)


def _document(text: bytes) -> Document:
    text = as_utf8(text).rstrip(b"\0 \t\r\n")
    try:
        document = Document.model_validate_json(text)
    except ValidationError as error:
        first = error.errors(include_url=False, include_context=False, include_input=False)[0]
        place = "/".join(str(part) for part in first["loc"][:8])
        at = f" at {place}" if place else ""
        raise UnreadableFile(
            f"the JSON of the {Format.GLB} is not that of a glTF 2.0{at}: {first['msg'][:200]}"
        ) from error
    asset = document.asset
    needed = asset.minVersion or asset.version
    if needed.split(".")[0] != "2" or needed not in ("2", "2.0"):
        raise _other_version(needed)
    return document


def _other_version(version: str) -> UnreadableFile:
    return UnreadableFile(
        f"the {Format.GLB} is glTF {version[:20]}, which is not read",
        remedy="export the part as glTF 2.0 (GLB)",
    )
