"""PLY, ASCII and binary."""

import re

from pipeline.core.errors import TruncatedFile
from pipeline.core.formats import Format
from pipeline.core.settings import LoadSettings
from pipeline.stages.load.by_trimesh import read_by_trimesh
from pipeline.stages.load.contents import Contents


def read_ply(data: bytes, settings: LoadSettings) -> Contents:
    """The triangles or points of a PLY."""
    contents = read_by_trimesh(data, Format.PLY)
    vertices = sum(len(body.vertices) for body in contents.bodies)
    faces = sum(len(body.faces) for body in contents.bodies)
    _check_complete(data, vertices, faces)
    return contents


def _check_complete(data: bytes, n_vertices: int, n_faces: int) -> None:
    header = data[: data.find(b"end_header")]
    for element, count in ((rb"vertex", n_vertices), (rb"face", n_faces)):
        announced = re.search(rb"element\s+" + element + rb"\s+(\d+)", header)
        if announced and count < int(announced[1]):
            raise TruncatedFile(
                f"the PLY announces {int(announced[1])} {element.decode()} rows and has {count}"
            )
