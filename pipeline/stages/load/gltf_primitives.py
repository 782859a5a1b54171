"""Triangles and points of one primitive of a glTF 2.0, in the frame of its mesh.

Source: glTF 2.0 specification, section 3.7.2.
"""

from collections import Counter
from dataclasses import dataclass, field

import numpy as np

from pipeline.core.errors import IndexOutOfRange, MeshTooLarge
from pipeline.core.formats import Format
from pipeline.core.mesh import FloatArray, IndexArray
from pipeline.stages.load.gltf_accessors import Accessors
from pipeline.stages.load.gltf_draco import DRACO, decoded
from pipeline.stages.load.gltf_records import FAN, POINTS, STRIP, TRIANGLES, Primitive


@dataclass(frozen=True, slots=True, eq=False)
class Local:
    """vertices : (n, 3); faces : (m, 3), none of points; rows : (n,) of the accessors of attributes, or None
    for all; has_remainder : whether corners are left that are no whole triangle; is_decoded : whether the
    accessors have no values, because another source was decoded
    """

    vertices: FloatArray
    faces: IndexArray
    rows: IndexArray | None = None
    has_remainder: bool = False
    is_decoded: bool = False


@dataclass(slots=True, eq=False)
class Primitives:
    """Reads primitives, each once."""

    accessors: Accessors
    _read: dict[tuple[int, int], Local] = field(default_factory=dict)
    _uses: Counter[int] = field(default_factory=Counter)

    def __post_init__(self) -> None:
        for mesh in self.accessors.container.document.meshes:
            self._uses.update(each.attributes["POSITION"] for each in mesh.primitives if has_shape(each))

    def read(self, mesh: int, number: int) -> Local:
        """The triangles or points of a primitive that `has_shape`.

        Vertices are those of its accessor; where primitives share it, those that this one uses.

        Raises
        ------
        UnreadableFile, TruncatedFile, IndexOutOfRange, MeshTooLarge
            With accessor, mesh and primitive.
        """
        if (mesh, number) not in self._read:
            primitive = self.accessors.container.document.meshes[mesh].primitives[number]
            where = f"mesh {mesh}, primitive {number}"
            self._read[mesh, number] = self._local(primitive, where)
        return self._read[mesh, number]

    def _local(self, primitive: Primitive, where: str) -> Local:
        position = primitive.attributes["POSITION"]
        if DRACO in primitive.extensions and not self.accessors.has_data(position):
            return Local(*decoded(self.accessors, primitive, where), is_decoded=True)
        count = self.accessors.count(position, where)
        self._check(count, primitive, where)
        if primitive.indices is None:
            corners = None
        else:
            corners = self.accessors.integers(primitive.indices, f"indices of {where}")[:, 0]
            outside = np.flatnonzero(corners >= count)
            if outside.size:
                raise IndexOutOfRange(
                    f"accessor {primitive.indices} (indices of {where}) of the {Format.GLB} refers to vertex "
                    f"{corners[outside[0]]}, but there are {count}, counted from 0"
                )
        rows = None
        if corners is not None and (primitive.mode == POINTS or self._uses[position] > 1):
            rows, corners = np.unique(corners, return_inverse=True)
        vertices = self.accessors.floats(position, f"positions of {where}", "VEC3", rows)
        if primitive.mode == POINTS:
            return Local(vertices, np.zeros((0, 3), dtype=np.int64), rows)
        faces, has_remainder = _triangles(np.arange(count) if corners is None else corners, primitive.mode)
        return Local(vertices, faces, rows, has_remainder)

    def _check(self, vertices: int, primitive: Primitive, where: str) -> None:
        """Refuse announced sizes beyond the limits, before memory is taken for them."""
        settings = self.accessors.settings
        corners = vertices
        if primitive.indices is not None:
            corners = self.accessors.count(primitive.indices, f"indices of {where}")
        faces = (
            0 if primitive.mode == POINTS else corners // 3 if primitive.mode == TRIANGLES else corners - 2
        )
        if faces > settings.max_faces or vertices > settings.max_vertices:
            raise MeshTooLarge(
                f"{where} of the {Format.GLB} has {faces} triangles and {vertices} vertices; the limits are "
                f"{settings.max_faces} and {settings.max_vertices}"
            )


def has_shape(primitive: Primitive) -> bool:
    """Whether it has triangles or points with positions."""
    return "POSITION" in primitive.attributes and primitive.mode in (POINTS, TRIANGLES, STRIP, FAN)


def _triangles(corners: IndexArray, mode: int) -> tuple[IndexArray, bool]:
    """(m, 3), and whether corners are left over. Of a strip, without the triangles that only connect its
    parts: those with a vertex twice.
    """
    if mode == TRIANGLES:
        whole = len(corners) // 3 * 3
        return corners[:whole].reshape(-1, 3), whole < len(corners)
    step = np.arange(max(len(corners) - 2, 0))
    if mode == FAN:
        faces = np.column_stack(
            [corners[step + 1], corners[step + 2], np.broadcast_to(corners[:1], step.shape)]
        )
        return faces, 0 < len(corners) < 3
    odd = step % 2
    faces = np.column_stack([corners[step], corners[step + 1 + odd], corners[step + 2 - odd]])
    a, b, c = faces.T
    return faces[(a != b) & (b != c) & (c != a)], 0 < len(corners) < 3
