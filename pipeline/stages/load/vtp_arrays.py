"""The arrays of a VTK XML file: text, base64 or raw bytes, perhaps in compressed blocks.

A binary array starts with its size: [bytes], or of compressed data [blocks, bytes of a block, bytes of the
last one or 0, compressed bytes of each block].
"""

import binascii
import lzma
import re
import zlib
from typing import Any

import numpy as np
import numpy.typing as npt

from pipeline.core.errors import MeshTooLarge, TruncatedFile, UnreadableFile
from pipeline.core.settings import LoadSettings
from pipeline.stages.load.vtp_xml import VtkFile

TYPES = {
    "Int8": "i1",
    "UInt8": "u1",
    "Int16": "i2",
    "UInt16": "u2",
    "Int32": "i4",
    "UInt32": "u4",
    "Int64": "i8",
    "UInt64": "u8",
    "Float32": "f4",
    "Float64": "f8",
}
#: Base64 in pieces: writers end the sizes with their own padding, or do not.
_BASE64 = re.compile(rb"[A-Za-z0-9+/]+={0,2}")
ZLIB, LZMA = "vtkZLibDataCompressor", "vtkLZMADataCompressor"


class Arrays:
    """Reads arrays by their element.

    file_bytes : size of the file, which bounds what compressed arrays may expand to
    """

    def __init__(self, file: VtkFile, file_bytes: int, settings: LoadSettings) -> None:
        self._file = file
        self._room = settings.max_archive_expansion * file_bytes
        self._factor = settings.max_archive_expansion
        self._header = np.dtype(file.order + file.header)

    def read(self, node: Any, where: str) -> npt.NDArray[Any]:
        """(n,) values, of the type that the array declares.

        Raises
        ------
        TruncatedFile, UnreadableFile, MeshTooLarge
        """
        kind = TYPES.get(node.get("type") or "")
        if kind is None:
            raise UnreadableFile(
                f"the {where} of the VTP are of type {str(node.get('type'))[:40]}, which is not known"
            )
        layout = node.get("format") or "ascii"
        if layout == "ascii":
            return _of_text(node.text or "", np.dtype(kind), where)
        if layout == "binary":
            content = _decoded((node.text or "").encode(), where)
        elif layout == "appended":
            content = self._appended(node, where)
        else:
            raise UnreadableFile(
                f"the {where} of the VTP have the format {layout[:40]!r}, which is not known"
            )
        values = self._unpacked(content, where)
        dtype = np.dtype(self._file.order + kind)
        if len(values) % dtype.itemsize:
            raise UnreadableFile(
                f"the {where} of the VTP have {len(values)} bytes: no whole numbers of {dtype.itemsize}"
            )
        return np.frombuffer(values, dtype=dtype)

    def _appended(self, node: Any, where: str) -> bytes:
        offset = node.get("offset") or ""
        if not offset.isdigit() or int(offset) >= max(len(self._file.appended), 1):
            raise UnreadableFile(
                f"the {where} of the VTP are said to start at byte {offset[:20] or '?'} of "
                f"{len(self._file.appended)} appended ones"
            )
        content = self._file.appended[int(offset) :]
        return content if self._file.is_raw else _decoded(content, where, self._text_bytes(content, where))

    def _text_bytes(self, content: bytes, where: str) -> int:
        """How many characters of base64 the array has: the next one follows at once."""
        size = self._header.itemsize
        if self._file.compressor:
            first = self._sizes(_decoded(content, where, _characters(3 * size)), 3, where)
            n_blocks = self._checked(first, len(content), where)
            head = _characters((3 + n_blocks) * size)
            sizes = self._sizes(_decoded(content, where, head), 3 + n_blocks, where)
            return head + _characters(sum(sizes[3:])) if n_blocks else head
        (length,) = self._sizes(_decoded(content, where, _characters(size)), 1, where)
        # the size alone, with its padding, and the data: longer than both as one text
        return _characters(size) + _characters(length)

    def _sizes(self, content: bytes, count: int, where: str) -> list[int]:
        if len(content) < count * self._header.itemsize:
            raise TruncatedFile(f"the {where} of the VTP end within their sizes")
        return [int(each) for each in np.frombuffer(content, dtype=self._header, count=count)]

    def _unpacked(self, content: bytes, where: str) -> bytes:
        """The bytes of an array, without its sizes."""
        if self._file.compressor:
            return self._inflated(content, where)
        (length,) = self._sizes(content, 1, where)
        start = self._header.itemsize
        if length > len(content) - start:
            raise TruncatedFile(
                f"the {where} of the VTP announce {length} bytes, and {len(content) - start} are there"
            )
        return content[start : start + length]

    def _checked(self, sizes: list[int], room: int, where: str) -> int:
        """The number of blocks, after its plausibility was checked."""
        n_blocks, block, last = sizes[:3]
        if n_blocks > room:
            raise TruncatedFile(
                f"the {where} of the VTP announce {n_blocks} blocks, more than the file holds"
            )
        if n_blocks * block > self._room or last > self._room:
            raise MeshTooLarge(
                f"the {where} of the VTP unpack to {n_blocks * block} bytes; "
                f"the limit is {self._factor} times the size of the file"
            )
        return n_blocks

    def _inflated(self, content: bytes, where: str) -> bytes:
        n_blocks = self._checked(self._sizes(content, 3, where), len(content), where)
        _, block, last, *packed = self._sizes(content, 3 + n_blocks, where)
        position = (3 + n_blocks) * self._header.itemsize
        blocks = []
        for number, size in enumerate(packed):
            expected = last if last and number == n_blocks - 1 else block
            if position + size > len(content):
                raise TruncatedFile(f"the {where} of the VTP end in block {number} of {n_blocks}")
            inflated = self._inflate(content[position : position + size], expected + 1, where)
            if len(inflated) != expected:
                raise UnreadableFile(
                    f"block {number} of the {where} of the VTP unpacks to {len(inflated)} bytes, "
                    f"not {expected}"
                )
            blocks.append(inflated)
            position += size
        return b"".join(blocks)

    def _inflate(self, packed: bytes, limit: int, where: str) -> bytes:
        name = self._file.compressor
        try:
            if name == ZLIB:
                return zlib.decompressobj().decompress(packed, limit)
            if name == LZMA:
                return lzma.LZMADecompressor().decompress(packed, limit)
        except (zlib.error, lzma.LZMAError, EOFError) as error:
            raise UnreadableFile(f"the {where} of the VTP cannot be unpacked ({error})") from error
        raise UnreadableFile(
            f"the arrays of the VTP are compressed by {name[:40]}, which is not read",
            remedy="save the VTP with the compressor ZLib, or without",
        )


def _characters(n_bytes: int) -> int:
    """Characters of base64 for so many bytes."""
    return -(-n_bytes // 3) * 4


def _decoded(text: bytes, where: str, limit: int | None = None) -> bytes:
    """Bytes of base64, of the first `limit` characters."""
    text = b"".join(text[:limit].split())
    try:
        return b"".join(binascii.a2b_base64(piece, strict_mode=True) for piece in _pieces(text))
    except binascii.Error as error:
        raise UnreadableFile(f"the {where} of the VTP are no valid base64 ({error})") from error


def _pieces(text: bytes) -> list[bytes]:
    pieces = _BASE64.findall(text)
    if sum(map(len, pieces)) != len(text):
        raise binascii.Error("other characters")
    return pieces


def _of_text(text: str, dtype: "np.dtype[Any]", where: str) -> npt.NDArray[Any]:
    words = text.split()
    try:
        values = np.array(words, dtype=np.float64 if dtype.kind == "f" else np.int64)
    except (ValueError, OverflowError) as error:
        raise UnreadableFile(
            f"the {where} of the VTP have a word that is no number ({str(error)[:80]})"
        ) from error
    return values
