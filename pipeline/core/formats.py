"""Detects the format of a mesh file from its first bytes and its size, without parsing it.

The API calls this for an upload, so an empty, truncated or unsupported file is rejected at once. The parsers
(`stages/load/`) run only in the child process.
"""

import re
from enum import StrEnum
from pathlib import PurePath

from pipeline.core.errors import EmptyFile, TruncatedFile, UnknownFormat, UnreadableFile
from pipeline.core.foreign_files import Foreign, by_ending, foreign_file, foreign_zip

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
    STEP = "step"
    LAS = "las"
    E57 = "e57"
    VTP = "vtp"
    AMF = "amf"


STL_HEADER_BYTES = 84
STL_FACE_BYTES = 50
#: Triangles in the header of a writer that did not know their number and could not go back.
STL_UNKNOWN_COUNT = 0xFFFFFFFF
# These expressions read untrusted input, and `re` holds the GIL. Each text can match in one way only, so a
# hostile text takes time in proportion to its length. (`\d+\.?\d*` would split a run of digits in as many
# ways as it is long.)
_NUMBER = rb"[-+]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][-+]?\d+)?|[-+]?(?:nan|inf)(?:inity)?"
_WORD_OF_ROW = re.compile(_NUMBER.replace(rb"[eE]", rb"[eEdD]"), re.IGNORECASE)
#: Words of a heading for each axis of a point text: x, x[mm], X-coordinate, Points:0, Easting.
_AXES = tuple(
    re.compile(pattern, re.IGNORECASE)
    for pattern in (
        rb"(?<![a-z])x(?![a-z])|x-?(?:coord|pos|koord|wert)|(?:coord|pos|point)x|points?[:_]0|\beast|rechtswert",
        rb"(?<![a-z])y(?![a-z])|y-?(?:coord|pos|koord|wert)|(?:coord|pos|point)y|points?[:_]1|\bnorth|hochwert",
        rb"(?<![a-z])z(?![a-z])|z-?(?:coord|pos|koord|wert)|(?:coord|pos|point)z|points?[:_]2|\bheight|\belev"
        rb"|\balt(?:itude)?\b|\bh(?:\xc3\xb6|\xf6|oe)he\b|\bup\b",
    )
)
#: The minus sign of typography, in UTF-8.
MINUS = b"\xe2\x88\x92"
_WORD_ENDS = bytes.maketrans(b",;|\"'", b"     ")
_COMMENTS = (b"#", b"//", b"%", b"!")
_POINT_SUFFIXES = (".xyz", ".asc", ".pts", ".ptx", ".txt", ".csv")
#: Lines before the first point in which `detect_format` looks for a heading.
_HEAD_LINES = 200
_OBJ_LINE = re.compile(rb"^[^\S\n]*(?:v|vn|vt|f|o|g|s|mtllib|usemtl)[^\S\n]+\S", re.MULTILINE)
#: A key that glTF as JSON has at its top.
_GLTF_KEY = re.compile(rb'"(?:asset|accessors|bufferViews|buffers|meshes|nodes|scenes?)"\s*:')
#: The first word of a Part 21 file, after comments. A comment is matched in one way only.
_STEP_HEAD = re.compile(rb"(?:/\*(?:[^*]|\*(?!/))*\*/\s*)*ISO-10303-21\s*;")
_VTK_ROOT = re.compile(rb"<VTKFile\s")
_AMF_ROOT = re.compile(rb"<amf[\s>]", re.IGNORECASE)
#: What a zip archive starts with, and an entry of it: bytes of the name are counted at 26, and follow at 30.
ZIP = b"PK\x03\x04"
_ZIP_NAME_LENGTH, _ZIP_NAME = 26, 30
#: Characters of a name that are looked at; longer ones are told by the reader.
_MAX_ZIP_NAME = 256


def as_utf8(data: bytes) -> bytes:
    """Text with a byte order mark, of UTF-8 or UTF-16, as UTF-8 without one; other data unchanged.

    PowerShell redirects output to files as UTF-16. Characters that are cut or invalid become U+FFFD.
    """
    if data.startswith(b"\xef\xbb\xbf"):
        return data[3:]
    if data.startswith((b"\xff\xfe", b"\xfe\xff")):
        return data.decode("utf-16", errors="replace").encode("utf-8", errors="replace")
    return data


def detect_format(head: bytes, size: int, filename: str | None = None, mesh: str | None = None) -> Format:
    """The format of a file of `size` bytes that starts with `head` (up to `HEAD_BYTES`).

    The content decides; the file name only separates what content cannot (a binary STL has no signature).

    Raises
    ------
    EmptyFile, TruncatedFile (a binary STL shorter than its header announces), UnreadableFile (zeros only),
    UnknownFormat
    """
    if size == 0:
        raise EmptyFile("the file is empty", mesh=mesh)
    text = as_utf8(head).lstrip()
    suffix = PurePath(filename).suffix.lower() if filename else ""
    if text.startswith((b"ply\n", b"ply\r")):
        return Format.PLY
    if head.startswith(b"glTF") or (text.startswith(b"{") and _GLTF_KEY.search(text)):
        return Format.GLB
    if head.startswith(b"LASF"):
        return Format.LAS
    if head.startswith(b"ASTM-E57"):
        return Format.E57
    if head.startswith(ZIP):
        kind = _format_of_zip(head, suffix)
        if kind is Format.THREE_MF:  # also where the names say nothing
            _refuse(foreign_zip(head, suffix), mesh)
        return kind
    if text.startswith(b"<") and _VTK_ROOT.search(text):
        return Format.VTP
    if text.startswith(b"<") and _AMF_ROOT.search(text):
        return Format.AMF
    if _STEP_HEAD.match(text):
        return Format.STEP
    if re.match(rb"(?:ST|[CN4n]){0,5}OFF(?![A-Za-z_])", text):
        return Format.OFF
    if _is_text_stl(text, suffix):
        return Format.STL
    if not _has_size_of_stl(head, size):
        _refuse(foreign_file(head, text, suffix), mesh)
    if len(head) == HEAD_BYTES and not any(head):
        raise UnreadableFile(
            f"the first {HEAD_BYTES} bytes are all zero, as after a failed copy or download",
            mesh=mesh,
            remedy="copy or download the file again",
        )
    if _is_binary_stl(head, size, suffix, mesh):
        return Format.STL
    if b"\0" not in text:
        if _OBJ_LINE.search(text):
            return Format.OBJ
        if _is_point_text(text, suffix, whole=size <= len(head)):
            return Format.XYZ
    _refuse(by_ending(suffix), mesh)
    name = f" (its name ends in {suffix!r})" if suffix else ""
    raise UnknownFormat(f"the content of the file is in no supported format{name}", mesh=mesh)


def _refuse(foreign: Foreign | None, mesh: str | None) -> None:
    if foreign is not None:
        raise UnknownFormat(f"the file is {foreign.what}", mesh=mesh, remedy=foreign.remedy)


def _has_size_of_stl(head: bytes, size: int) -> bool:
    """Whether the size is exactly that of a binary STL, which has no signature and any text at its start."""
    if len(head) < STL_HEADER_BYTES:
        return False
    return size == STL_HEADER_BYTES + STL_FACE_BYTES * int.from_bytes(head[80:84], "little")


def format_of_entry(name: str) -> Format | None:
    """The format that a file in a zip archive stands for, by its name; None when it says nothing."""
    lowered = name.lower()
    if lowered.endswith(".model") or lowered in ("[content_types].xml", "_rels/.rels"):
        return Format.THREE_MF
    if lowered.endswith(".amf"):
        return Format.AMF
    return Format.GLB if lowered.endswith((".gltf", ".glb")) else None


def _format_of_zip(head: bytes, suffix: str) -> Format:
    """By the names of the files that start within `head`, and the name of the archive; 3MF where nothing is
    said. The reader looks at all names.
    """
    at = 0
    while at >= 0 and at + _ZIP_NAME < len(head):
        length = int.from_bytes(head[at + _ZIP_NAME_LENGTH : at + _ZIP_NAME_LENGTH + 2], "little")
        name = head[at + _ZIP_NAME : at + _ZIP_NAME + min(length, _MAX_ZIP_NAME)]
        kind = format_of_entry(name.decode("utf-8", errors="replace"))
        if kind is not None:
            return kind
        at = head.find(ZIP, at + _ZIP_NAME)
    return {".amf": Format.AMF, ".gltf": Format.GLB, ".glb": Format.GLB}.get(suffix, Format.THREE_MF)


def _is_text_stl(text: bytes, suffix: str) -> bool:
    """An ASCII STL starts with `solid`, or with a facet where `solid` was cut off."""
    lower = text.lower()
    if lower.startswith(b"solid"):
        cut_name = suffix == ".stl" and b"\0" not in text and not re.search(rb"[\r\n]", text)
        return b"facet" in lower or b"endsolid" in lower or cut_name
    return re.match(rb"facet\s+normal\s", lower) is not None


def numbers_in(line: bytes) -> tuple[int, int]:
    """How many numbers a line has, and how many words; a decimal comma separates words here."""
    words = line.replace(MINUS, b"-").translate(_WORD_ENDS).split()
    return sum(_WORD_OF_ROW.fullmatch(word) is not None for word in words), len(words)


def is_number_row(line: bytes) -> bool:
    """Whether a line has numbers only, with any delimiters; a comment may follow."""
    numbers, words = numbers_in(re.split(rb"\s(?:#|//)", line, maxsplit=1)[0])
    return numbers == words > 0


def names_axes(line: bytes) -> bool:
    """Whether a line, also a comment, has the names of x, y and z, as the heading of a point text does.

    `FIELDS x y z` is of a PCD, which has another structure.
    """
    return all(axis.search(line) for axis in _AXES) and not re.match(rb"#?\s*FIELDS\s", line)


def _is_point_text(text: bytes, suffix: str, *, whole: bool) -> bool:
    """Points, one a line: rows of numbers, after one line of any text; or any rows after a heading that names
    x, y and z. A line with one whole number counts the rows (.pts, .ptx).
    """
    lines = [line.strip() for line in re.split(rb"[\r\n]+", text)]
    if not whole:
        lines = lines[:-1]  # the last line of a partial head may be cut
    rows = [line for line in lines if line and not line.startswith(_COMMENTS)]
    if not rows:
        return not whole and suffix in _POINT_SUFFIXES and (len(lines) > 0 or _is_cut_row(text))
    head = next((at for at, line in enumerate(rows[:_HEAD_LINES]) if is_number_row(line)), len(rows))
    headings = [at for at, line in enumerate(rows[: min(head, _HEAD_LINES)]) if names_axes(line)]
    commented = any(line.startswith(_COMMENTS) and names_axes(line) for line in lines[:_HEAD_LINES])
    if headings or commented:
        first = headings[-1] + 1 if headings else 0
        if any(numbers_in(line)[0] >= 3 for line in rows[first:]):
            return True
    if head > 1:
        return False
    points = [is_number_row(line) and numbers_in(line)[0] >= 3 for line in rows[head:]]
    if suffix in _POINT_SUFFIXES and 2 * sum(points) >= len(points) > 0:
        return True  # the reader says which line is wrong
    counts = [line.isdigit() for line in rows[head:]]
    return any(points) and all(point or count for point, count in zip(points, counts, strict=True))


def _is_cut_row(text: bytes) -> bool:
    """Whether a row that is longer than the head has numbers only so far: a point with hundreds of values."""
    numbers, words = numbers_in(text)
    return numbers >= max(3, words - 1)  # the last word may be cut


def _is_binary_stl(head: bytes, size: int, suffix: str, mesh: str | None) -> bool:
    """A binary STL has no signature, only a length: 84 bytes, and 50 for each triangle of the header."""
    if len(head) < STL_HEADER_BYTES:
        if suffix == ".stl" and not _looks_like_text(head):
            raise TruncatedFile(
                f"a binary STL has a header of 84 bytes, but the file has {size} bytes", mesh=mesh
            )
        return False
    if _has_size_of_stl(head, size):
        return True
    announced = int.from_bytes(head[80:84], "little")
    if announced == STL_UNKNOWN_COUNT and size > STL_HEADER_BYTES:
        announced = 0  # written to a stream: the size says how many; the reader checks it
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
