"""STL, binary and ASCII."""

import struct

from pipeline.core.errors import MeshTooLarge, TruncatedFile
from pipeline.core.formats import STL_FACE_BYTES, STL_HEADER_BYTES, Format
from pipeline.core.settings import LoadSettings
from pipeline.stages.load.by_trimesh import read_by_trimesh
from pipeline.stages.load.contents import Contents


def read_stl(data: bytes, settings: LoadSettings) -> Contents:
    """The triangles of an STL, three vertices each."""
    if not _is_ascii_stl(data):
        (announced,) = struct.unpack("<I", data[80:84])
        if announced > settings.max_faces:
            raise MeshTooLarge(f"{announced} triangles; the limit is {settings.max_faces}")
        return read_by_trimesh(data, Format.STL)
    contents = read_by_trimesh(data, Format.STL)
    tail = data[-4096:].lower()
    if b"endsolid" not in tail and data.lower().count(b"endfacet") != data.lower().count(b"facet normal"):
        raise TruncatedFile("the ASCII STL ends inside a facet")
    return contents


def _is_ascii_stl(data: bytes) -> bool:
    announced = int.from_bytes(data[80:84], "little") if len(data) >= STL_HEADER_BYTES else -1
    return (
        len(data) != STL_HEADER_BYTES + STL_FACE_BYTES * announced and data.lstrip()[:5].lower() == b"solid"
    )
