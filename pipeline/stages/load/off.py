"""OFF, with its variants."""

import re

from pipeline.core.errors import TruncatedFile
from pipeline.core.formats import HEAD_BYTES, Format
from pipeline.core.settings import LoadSettings
from pipeline.stages.load.by_trimesh import read_by_trimesh
from pipeline.stages.load.contents import Contents


def read_off(data: bytes, settings: LoadSettings) -> Contents:
    """The polygons of an OFF, as triangles."""
    contents = read_by_trimesh(data, Format.OFF)
    vertices = sum(len(body.vertices) for body in contents.bodies)
    faces = sum(len(body.faces) for body in contents.bodies)
    _check_complete(data, vertices, faces)
    return contents


def _check_complete(data: bytes, n_vertices: int, n_faces: int) -> None:
    body = re.sub(rb"#[^\n]*", b"", data[:HEAD_BYTES])
    counts = re.match(rb"\s*\w*OFF\s+(\d+)\s+(\d+)", body)
    if counts and (n_vertices < int(counts[1]) or n_faces < int(counts[2])):
        raise TruncatedFile(
            f"the OFF announces {int(counts[1])} vertices and {int(counts[2])} faces, "
            f"and has {n_vertices} and {n_faces}"
        )
