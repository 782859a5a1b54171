"""The triangle mesh of all stages and kernels; its arrays are validated once, on construction."""

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, TypeAlias, TypeVar

import numpy as np
import numpy.typing as npt

from pipeline.core.errors import IndexOutOfRange, NotFinite

FloatArray: TypeAlias = npt.NDArray[np.float64]
IntArray: TypeAlias = npt.NDArray[np.int32]
IndexArray: TypeAlias = npt.NDArray[np.int64]
BoolArray: TypeAlias = npt.NDArray[np.bool_]
_Scalar = TypeVar("_Scalar", bound=np.generic)


@dataclass(frozen=True)  # no slots: areas and normals are cached
class Mesh:
    """A triangle mesh in millimetres; without faces, a point cloud.

    vertices : (n, 3) float64 mm, finite; faces : (m, 3) int32 in [0, n). Both are read-only: copies, but of
    arrays that nobody can write to.

    Raises
    ------
    NotFinite, IndexOutOfRange
    """

    vertices: FloatArray
    faces: IntArray = field(default_factory=lambda: np.zeros((0, 3), dtype=np.int32))

    def __post_init__(self) -> None:
        vertices = _own(np.asarray(self.vertices, dtype=np.float64).reshape(-1, 3), self.vertices)
        indices = np.asarray(self.faces).reshape(-1, 3)
        if not np.isfinite([vertices.min(initial=0.0), vertices.max(initial=0.0)]).all():
            bad = np.flatnonzero(~np.isfinite(vertices).all(axis=1))
            raise NotFinite(
                f"{bad.size} of {len(vertices)} vertices are NaN or infinite; the first has index {bad[0]}"
            )
        if indices.size and (indices.min() < 0 or indices.max() >= len(vertices)):
            face = int(np.flatnonzero(((indices < 0) | (indices >= len(vertices))).any(axis=1))[0])
            raise IndexOutOfRange(
                f"triangle {face} refers to vertices {indices[face].tolist()}, "
                f"but the mesh has {len(vertices)} vertices"
            )
        faces = _own(indices.astype(np.int32, copy=False), self.faces)
        vertices.flags.writeable = False
        faces.flags.writeable = False
        object.__setattr__(self, "vertices", vertices)
        object.__setattr__(self, "faces", faces)

    @property
    def is_cloud(self) -> bool:
        """Whether the mesh has no faces."""
        return len(self.faces) == 0

    @property
    def diagonal_mm(self) -> float:
        """Length of the diagonal of the axis-aligned bounding box."""
        return float(np.linalg.norm(np.ptp(self.vertices, axis=0)))

    def face_cross_mm2(self) -> FloatArray:
        """(m, 3) cross product of two edges of each face: twice the area, along the normal; read-only."""
        return self._face_cross_mm2

    @cached_property
    def _face_cross_mm2(self) -> FloatArray:
        a, first, second = (self.vertices[self.faces[:, k]] for k in range(3))
        first -= a
        second -= a
        del a  # of a million triangles each of these takes 24 MB
        return _read_only(np.asarray(np.cross(first, second), dtype=np.float64))

    def face_areas_mm2(self) -> FloatArray:
        """(m,) triangle areas; read-only."""
        return self._face_areas_mm2

    @cached_property
    def _face_areas_mm2(self) -> FloatArray:
        return _read_only(np.asarray(0.5 * np.linalg.norm(self.face_cross_mm2(), axis=1), dtype=np.float64))

    def vertex_areas_mm2(self) -> FloatArray:
        """(n,) lumped (barycentric) areas, a third of the incident triangles; the sum is the mesh area;
        read-only.
        """
        return self._vertex_areas_mm2

    @cached_property
    def _vertex_areas_mm2(self) -> FloatArray:
        return _read_only(self._sums_at_corners((self.face_areas_mm2() / 3.0)[:, None])[:, 0])

    def weights(self) -> FloatArray:
        """(n,) weight of each vertex in area-weighted statistics, sum 1, read-only; equal for a cloud."""
        return self._weights

    @cached_property
    def _weights(self) -> FloatArray:
        if self.is_cloud:
            return _read_only(np.full(len(self.vertices), 1.0 / len(self.vertices)))
        areas = self.vertex_areas_mm2()
        return _read_only(areas / float(areas.sum()))

    def vertex_normals(self) -> FloatArray:
        """(n, 3) unit normals, area-weighted over incident triangles; zero where undefined; read-only."""
        return self._vertex_normals

    @cached_property
    def _vertex_normals(self) -> FloatArray:
        summed = self._sums_at_corners(self.face_cross_mm2())
        length = np.linalg.norm(summed, axis=1, keepdims=True)
        return _read_only(np.divide(summed, length, out=np.zeros_like(summed), where=length > 0))

    def _sums_at_corners(self, of_faces: FloatArray) -> FloatArray:
        """(n, c) sum over the incident triangles of each vertex. of_faces : (m, c)"""
        corners = self.faces.ravel().astype(np.intp)
        count = len(self.vertices)
        return np.stack(
            [np.bincount(corners, weights=np.repeat(column, 3), minlength=count) for column in of_faces.T],
            axis=1,
        )

    def moved(self, T_target_mesh: FloatArray) -> "Mesh":
        """The same mesh in another frame: `p_target = T_target_mesh @ p`."""
        return Mesh(self.vertices @ T_target_mesh[:3, :3].T + T_target_mesh[:3, 3], self.faces)


def _read_only(array: FloatArray) -> FloatArray:
    array.flags.writeable = False
    return array


def frozen(array: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """The same array, which nobody can write to any more: `Mesh` takes it without a copy."""
    at: Any = array
    while isinstance(at, np.ndarray):
        at.flags.writeable = False
        at = at.base
    return array


def _own(array: npt.NDArray[_Scalar], source: npt.NDArray[Any]) -> npt.NDArray[_Scalar]:
    """`array` in C order, a copy where it shares memory with `source` and somebody can write to that."""
    array = np.ascontiguousarray(array)
    at: Any = source
    while isinstance(at, np.ndarray) and not at.flags.writeable:
        at = at.base
    is_shared = isinstance(at, np.ndarray) and np.may_share_memory(array, source)
    return array.copy() if is_shared else array
