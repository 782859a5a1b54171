"""Detects the format of a mesh file from its first bytes and its size, without parsing it.

The API calls this for an upload, so an empty, truncated or unsupported file is rejected at once. The parsers
(`stages/load/`) run only in the child process.
"""

import re
from enum import StrEnum
from pathlib import PurePath

from pipeline.core.errors import EmptyFile, TruncatedFile, UnknownFormat

#: Bytes at the start of a file that `detect_format` needs.
HEAD_BYTES = 4096


class Format(StrEnum):
    STL = "stl"
    PLY = "ply"
    OBJ = "obj"
    OFF = "off"
    THREE_MF = "3mf"
    GLB = "glb"
    XYZ = "xyz"


STL_HEADER_BYTES = 84
STL_FACE_BYTES = 50
# These expressions read untrusted input, and `re` holds the GIL. Each text can match in one way only, so a
# hostile text takes time in proportion to its length. (`\d+\.?\d*` would split a run of digits in as many
# ways as it is long.)
_NUMBER = rb"[-+]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][-+]?\d+)?|[-+]?(?:nan|inf)(?:inity)?"
_XYZ_LINE = re.compile(rb"^\s*(?:" + _NUMBER + rb")(?:[\s,;]+(?:" + _NUMBER + rb")){2,}\s*$", re.IGNORECASE)
_OBJ_LINE = re.compile(rb"^[^\S\n]*(?:v|vn|vt|f|o|g|s|mtllib|usemtl)[^\S\n]+\S", re.MULTILINE)


def detect_format(head: bytes, size: int, filename: str | None = None, mesh: str | None = None) -> Format:
    """The format of a file of `size` bytes that starts with `head` (up to `HEAD_BYTES`).

    The content decides; the file name only separates what content cannot (a binary STL has no signature).

    Raises
    ------
    EmptyFile, TruncatedFile (a binary STL shorter than its header announces), UnknownFormat
    """
    if size == 0:
        raise EmptyFile("the file is empty", mesh=mesh)
    text = head.removeprefix(b"\xef\xbb\xbf").lstrip()
    suffix = PurePath(filename).suffix.lower() if filename else ""
    if text.startswith((b"ply\n", b"ply\r")):
        return Format.PLY
    if head.startswith(b"glTF"):
        return Format.GLB
    if head.startswith(b"PK\x03\x04"):
        return Format.THREE_MF
    if re.match(rb"(?:ST)?C?N?4?n?OFF\b", text):
        return Format.OFF
    if text[:5].lower() == b"solid" and (b"facet" in text.lower() or b"endsolid" in text.lower()):
        return Format.STL
    if _is_binary_stl(head, size, suffix, mesh):
        return Format.STL
    if b"\0" not in head:
        if _OBJ_LINE.search(text):
            return Format.OBJ
        lines = [
            line for line in text.splitlines() if line.strip() and not line.lstrip().startswith((b"#", b"//"))
        ]
        whole = lines if size <= len(head) else lines[:-1]  # the last line of a partial head may be cut
        if whole and (_XYZ_LINE.match(whole[0]) or len(whole) > 1) and all(map(_XYZ_LINE.match, whole[1:])):
            return Format.XYZ  # the first line may be a header
    extension = f" (file name extension {suffix!r})" if suffix else ""
    raise UnknownFormat(f"the content is not in a supported mesh format{extension}", mesh=mesh)


def _is_binary_stl(head: bytes, size: int, suffix: str, mesh: str | None) -> bool:
    """A binary STL has no signature, only a length: 84 bytes, and 50 for each triangle of the header."""
    if len(head) < STL_HEADER_BYTES:
        if suffix == ".stl" and not _looks_like_text(head):
            raise TruncatedFile(
                f"a binary STL has a header of 84 bytes, but the file has {size} bytes", mesh=mesh
            )
        return False
    announced = int.from_bytes(head[80:84], "little")
    if size == STL_HEADER_BYTES + STL_FACE_BYTES * announced:
        return True
    if suffix != ".stl" or _looks_like_text(head):
        return False
    if size < STL_HEADER_BYTES + STL_FACE_BYTES * announced:
        raise TruncatedFile(
            f"the STL header announces {announced} triangles, which is "
            f"{STL_HEADER_BYTES + STL_FACE_BYTES * announced} bytes; the file has {size}",
            mesh=mesh,
        )
    return True  # bytes after the last triangle: some exporters append attributes


def _looks_like_text(head: bytes) -> bool:
    return b"\0" not in head and all(byte >= 32 or byte in b"\t\n\r\f" for byte in head[:512])
