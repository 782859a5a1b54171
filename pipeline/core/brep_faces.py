"""The faces of a CAD model (planes, cylinders, ...), and the triangles that stand for each."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipeline.core.mesh import IndexArray, IntArray

#: Number of the face of a triangle that belongs to none.
NO_FACE = -1


@dataclass(frozen=True, slots=True)
class BrepFace:
    """name : in the file, often empty; kind : of its surface: plane, cylinder, cone, sphere, torus, other;
    body : name of the body it belongs to
    """

    name: str
    kind: str
    body: str = ""


@dataclass(frozen=True, slots=True, eq=False)
class BrepFaces:
    """of_triangle : (m,) int32 face of each triangle, an index of `faces`, `NO_FACE` where it has none"""

    of_triangle: IntArray
    faces: tuple[BrepFace, ...]

    def part(self, triangles: slice) -> "BrepFaces":
        """Those of some consecutive triangles, numbered from 0."""
        used, of_triangle = np.unique(self.of_triangle[triangles], return_inverse=True)
        return BrepFaces(of_triangle.astype(np.int32), tuple(self.faces[number] for number in used))

    def at(self, triangles: IndexArray) -> "BrepFaces":
        """The same faces on other triangles, given the one (k,) of these that each lies on."""
        return BrepFaces(self.of_triangle[triangles], self.faces)


def joined(bodies: Sequence[tuple[str, int, BrepFaces | None]]) -> BrepFaces | None:
    """The faces of several bodies one after the other; None where no body has any.

    bodies : name, number of triangles and faces of each
    """
    if all(part is None for _, _, part in bodies):
        return None
    faces: list[BrepFace] = []
    of_triangle = []
    for name, count, part in bodies:
        if part is None:
            of_triangle.append(np.full(count, NO_FACE, dtype=np.int32))
        else:
            of_triangle.append(part.of_triangle + np.int32(len(faces)))
            faces.extend(replace(face, body=name) for face in part.faces)
    return BrepFaces(np.concatenate(of_triangle), tuple(faces))
