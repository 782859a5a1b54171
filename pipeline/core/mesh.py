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
        a, b, c = (self.vertices[self.faces[:, k]] for k in range(3))
        cross = np.asarray(np.cross(b - a, c - a), dtype=np.float64)
        cross.flags.writeable = False
        return cross

    def face_areas_mm2(self) -> FloatArray:
        """(m,) triangle areas; read-only."""
        return self._face_areas_mm2

    @cached_property
    def _face_areas_mm2(self) -> FloatArray:
        areas = np.asarray(0.5 * np.linalg.norm(self.face_cross_mm2(), axis=1), dtype=np.float64)
        areas.flags.writeable = False
        return areas

    def vertex_areas_mm2(self) -> FloatArray:
        """(n,) lumped (barycentric) areas, a third of the incident triangles; the sum is the mesh area."""
        thirds = np.repeat(self.face_areas_mm2() / 3.0, 3)
        return np.bincount(self.faces.ravel(), weights=thirds, minlength=len(self.vertices)).astype(
            np.float64
        )

    def weights(self) -> FloatArray:
        """(n,) weight of each vertex in area-weighted statistics, sum 1; equal for a point cloud."""
        if self.is_cloud:
            return np.full(len(self.vertices), 1.0 / len(self.vertices))
        areas = self.vertex_areas_mm2()
        total: float = float(areas.sum())
        return areas / total

    def vertex_normals(self) -> FloatArray:
        """(n, 3) unit normals, area-weighted over incident triangles; zero where undefined."""
        cross = np.repeat(self.face_cross_mm2(), 3, axis=0)
        flat = self.faces.ravel()
        summed = np.stack(
            [np.bincount(flat, weights=cross[:, k], minlength=len(self.vertices)) for k in range(3)], 1
        )
        length = np.linalg.norm(summed, axis=1, keepdims=True)
        unit: FloatArray = np.divide(summed, length, out=np.zeros_like(summed), where=length > 0)
        return unit

    def moved(self, T_target_mesh: FloatArray) -> "Mesh":
        """The same mesh in another frame: `p_target = T_target_mesh @ p`."""
        return Mesh(self.vertices @ T_target_mesh[:3, :3].T + T_target_mesh[:3, 3], self.faces)


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
