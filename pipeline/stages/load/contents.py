"""What a reader returns: the bodies of a file, as they lie in it."""

from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from pipeline.core.errors import IndexOutOfRange
from pipeline.core.mesh import FloatArray, IndexArray
from pipeline.core.results import Note
from pipeline.core.settings import LoadSettings


@dataclass(frozen=True, slots=True, eq=False)
class Body:
    """vertices : (n, 3) float64, unit and frame of the file, transforms of the file applied; faces : (m, 3)
    int64, none of a point cloud; name : as the file calls it, or empty
    """

    vertices: FloatArray
    faces: IndexArray
    name: str = ""

    @classmethod
    def cloud(cls, points: FloatArray, name: str = "") -> "Body":
        """Points (n, 3) without triangles."""
        return cls(points, np.zeros((0, 3), dtype=np.int64), name)


@dataclass(frozen=True, slots=True, eq=False)
class Contents:
    """unit : that the file declares, a key of `units.DECLARED`, or None; notes : what the file has that is
    not used, each with what, how much and what it does to the result; scanner_positions : (k, 3), unit and
    frame of the bodies, where the file says where its scanner stood
    """

    bodies: tuple[Body, ...]
    unit: str | None = None
    notes: tuple[Note, ...] = ()
    scanner_positions: FloatArray = field(default_factory=lambda: np.zeros((0, 3)))


class Reader(Protocol):
    """Reads the bytes of one format.

    Raises
    ------
    TruncatedFile, UnreadableFile, IndexOutOfRange, MeshTooLarge
        With what is wrong, and where (line, element, chunk); without the name of the input.
    """

    def __call__(self, data: bytes, settings: LoadSettings) -> Contents: ...


def joined(contents: Contents) -> tuple[FloatArray, IndexArray]:
    """Vertices (n, 3) and faces (m, 3) of all bodies; of those with triangles, where there are any.

    Raises
    ------
    IndexOutOfRange
        When a triangle refers to a vertex that its body does not have.
    """
    with_faces = [body for body in contents.bodies if len(body.faces)]
    vertices, faces, count = [np.zeros((0, 3))], [np.zeros((0, 3), dtype=np.int64)], 0
    for body in with_faces or contents.bodies:
        if body.faces.size and (body.faces.min() < 0 or body.faces.max() >= len(body.vertices)):
            outside = (body.faces < 0) | (body.faces >= len(body.vertices))
            face, corner = np.argwhere(outside)[0]
            raise IndexOutOfRange(
                f"triangle {face} refers to vertex {body.faces[face, corner]}, but the mesh has "
                f"{len(body.vertices)} vertices, counted from 0"
            )
        vertices.append(body.vertices)
        faces.append(body.faces + count)
        count += len(body.vertices)
    return np.concatenate(vertices), np.concatenate(faces)
