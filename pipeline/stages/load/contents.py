"""What a reader returns: the bodies of a file, as they lie in it."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from pipeline.core.brep_faces import BrepFaces
from pipeline.core.errors import IndexOutOfRange
from pipeline.core.mesh import FloatArray, IndexArray, IntArray
from pipeline.core.results import Note
from pipeline.core.settings import LoadSettings


@dataclass(frozen=True, slots=True)
class FilePart:
    """Something that a person would call one part: a build item of a 3MF, a mesh of a glTF."""

    number: int
    name: str


@dataclass(frozen=True, slots=True, eq=False)
class Body:
    """vertices : (n, 3) float64, unit and frame of the file, transforms of the file applied; faces : (m, 3)
    int64 or int32, none of a point cloud; name : as the file calls it, or empty;
    part : of the file that it belongs to, None where it is one itself; scanner : (3,) where the scanner stood
    that measured it, in the frame of the vertices, None where the file does not say; brep : faces of the CAD
    model that the triangles stand for, None where the file has none
    """

    vertices: FloatArray
    faces: IndexArray | IntArray
    name: str = ""
    part: FilePart | None = None
    scanner: FloatArray | None = None
    brep: BrepFaces | None = None

    @classmethod
    def cloud(cls, points: FloatArray, name: str = "", scanner: FloatArray | None = None) -> "Body":
        """Points (n, 3) without triangles. scanner : as above"""
        return cls(points, np.zeros((0, 3), dtype=np.int64), name, scanner=scanner)


@dataclass(frozen=True, slots=True, eq=False)
class Contents:
    """unit : that the file declares, a key of `units.DECLARED`, or None; notes : what the file has that is
    not used, each with what, how much and what it does to the result
    """

    bodies: tuple[Body, ...]
    unit: str | None = None
    notes: tuple[Note, ...] = ()


class Reader(Protocol):
    """Reads the bytes of one format.

    Raises
    ------
    TruncatedFile, UnreadableFile, IndexOutOfRange, MeshTooLarge
        With what is wrong, and where (line, element, chunk); without the name of the input.
    """

    def __call__(self, data: bytes, settings: LoadSettings) -> Contents: ...


def joined(contents: Contents) -> tuple[FloatArray, IndexArray | IntArray]:
    """Vertices (n, 3) and faces (m, 3) of all bodies; of those with triangles, where there are any.

    Raises
    ------
    IndexOutOfRange
        When a triangle refers to a vertex that its body does not have.
    """
    bodies = used_bodies(contents)
    for body in bodies:
        _check_faces(body)
    if len(bodies) == 1:  # large files are one body: no copy
        return bodies[0].vertices, bodies[0].faces
    starts = np.cumsum([0, *(len(body.vertices) for body in bodies)])
    vertices = np.concatenate([np.zeros((0, 3)), *(body.vertices for body in bodies)])
    shifted = [body.faces + start for body, start in zip(bodies, starts, strict=False)]
    return vertices, np.concatenate([np.zeros((0, 3), dtype=np.int64), *shifted])


def used_bodies(contents: Contents) -> tuple[Body, ...]:
    """The bodies with triangles, where there are any."""
    with_faces = tuple(body for body in contents.bodies if len(body.faces))
    return with_faces or contents.bodies


def _check_faces(body: Body) -> None:
    if body.faces.size and (body.faces.min() < 0 or body.faces.max() >= len(body.vertices)):
        outside = (body.faces < 0) | (body.faces >= len(body.vertices))
        face, corner = np.argwhere(outside)[0]
        raise IndexOutOfRange(
            f"triangle {face} refers to vertex {body.faces[face, corner]}, but the mesh has "
            f"{len(body.vertices)} vertices, counted from 0"
        )
