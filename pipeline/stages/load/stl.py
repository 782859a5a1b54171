"""STL, binary and ASCII: triangles with three vertices of their own each.

The format is that of 3D Systems, "StereoLithography Interface Specification", 1989. Normals, colours and
attributes are not used: the order of the corners says where the outside is.
"""

from pipeline.core.formats import STL_FACE_BYTES, STL_HEADER_BYTES, as_utf8
from pipeline.core.settings import LoadSettings
from pipeline.stages.load.contents import Contents
from pipeline.stages.load.stl_ascii import read_ascii_stl
from pipeline.stages.load.stl_binary import read_binary_stl

#: Bytes at the start that have no zero byte where the file is text. Chosen by hand: the first triangles of a
#: binary STL have many.
TEXT_BYTES = 4096


def read_stl(data: bytes, settings: LoadSettings) -> Contents:
    """The triangles of an STL, coordinates as written: one body, or one for each solid of an ASCII file.

    Notes: `stl_count`, `several_stl`, `bytes_after_stl`, `decimal_comma`.

    Raises
    ------
    TruncatedFile, UnreadableFile, MeshTooLarge
        With line or triangle.
    """
    if is_binary_stl(data):
        return read_binary_stl(data, settings)
    return read_ascii_stl(as_utf8(data), settings)


def is_binary_stl(data: bytes) -> bool:
    """Whether the size is that of the header, or the start is no text of an STL."""
    if len(data) >= STL_HEADER_BYTES:
        announced = int.from_bytes(data[80:84], "little")
        if len(data) == STL_HEADER_BYTES + STL_FACE_BYTES * announced:
            return True
    start = as_utf8(data[:TEXT_BYTES]).lstrip().lower()
    return b"\0" in start or not start.startswith((b"solid", b"facet"))
