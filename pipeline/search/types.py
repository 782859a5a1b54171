"""The records that matching and registration pass on: a described mesh, hypotheses, matches, poses.

`T_design_scan` is (4, 4) throughout: p_design_mm = T_design_scan @ p_scan_mm.
"""

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from pipeline.core.landmark_set import LandmarkSet
from pipeline.core.mesh import FloatArray, IndexArray, Mesh
from pipeline.kernels import fpfh, sampling
from pipeline.search.schedule import MATCHING

Source = Literal["landmarks", "dense", "axes"]
SOURCES: tuple[Source, ...] = ("landmarks", "dense", "axes")

MIRROR = np.array([-1.0, 1.0, 1.0])  # reflection in the plane x = 0; a mirrored mesh lies in that frame


@dataclass(frozen=True, slots=True)
class Descriptors:
    """FPFH of some vertices. vertex : (k,) ascending; values : (k, 33)"""

    vertex: IndexArray
    values: FloatArray

    def at(self, vertices: IndexArray) -> FloatArray:
        """(l, 33) those of `vertices` (l,), which are among `vertex`."""
        return self.values[np.searchsorted(self.vertex, vertices)]


@dataclass(frozen=True, slots=True)
class DescribedMesh:
    """One mesh as matching uses it.

    mesh : the working mesh; landmarks : on it; spread : (s,) vertices by farthest-point sampling;
    descriptors : of the landmarks that matching uses, and of `spread`
    """

    mesh: Mesh
    landmarks: LandmarkSet
    spread: IndexArray
    descriptors: Descriptors

    @classmethod
    def of(cls, mesh: Mesh, landmarks: LandmarkSet, radius_mm: float) -> "DescribedMesh":
        """The mesh, its descriptors computed over neighbours nearer than `radius_mm`."""
        # As many as are spread on a design: any mesh may be matched as one.
        spread = sampling.farthest(mesh.vertices, MATCHING.dense_design_points)
        vertex = np.unique(np.concatenate([landmarks.vertex[: MATCHING.max_landmarks], spread]))
        return cls(mesh, landmarks, spread, Descriptors(vertex, fpfh.fpfh(mesh, radius_mm, vertex)))

    def mirrored(self) -> "DescribedMesh":
        """Its mirror image in the plane x = 0, with outward normals."""
        landmarks = replace(
            self.landmarks,
            position_mm=self.landmarks.position_mm * MIRROR,
            normal=self.landmarks.normal * MIRROR,
        )
        descriptors = replace(self.descriptors, values=fpfh.mirror(self.descriptors.values))
        return DescribedMesh(mirror_mesh(self.mesh), landmarks, self.spread, descriptors)


def mirror_mesh(mesh: Mesh) -> Mesh:
    """The mirror image of a mesh in the plane x = 0, its triangles reversed so that normals stay outward."""
    return Mesh(mesh.vertices * MIRROR, mesh.faces[:, ::-1])


@dataclass(frozen=True, slots=True)
class PosePool:
    """Candidate poses as arrays. T : (h, 4, 4) T_design_scan; normal_sign : (h,) +1, or -1 for flipped scan
    normals; source : (h,) index in `SOURCES`; cost_mm2 : (h,) truncated point-to-plane cost
    """

    T: FloatArray
    normal_sign: FloatArray
    source: IndexArray
    cost_mm2: FloatArray

    @classmethod
    def around(cls, T: FloatArray, pool: "PosePool") -> "PosePool":
        """Poses T (k, 4, 4) derived from the best of `pool`, with its normal sign and source."""
        return cls(T, np.full(len(T), pool.normal_sign[0]), np.full(len(T), pool.source[0]), np.zeros(len(T)))

    def take(self, index: IndexArray) -> "PosePool":
        """The poses with these numbers, in this order."""
        return PosePool(self.T[index], self.normal_sign[index], self.source[index], self.cost_mm2[index])

    def first(self, count: int) -> "PosePool":
        """The first `count` poses, or all."""
        return self.take(np.arange(min(len(self.T), count)))

    def merge(self, other: "PosePool") -> "PosePool":
        """The poses of both, lowest cost first; of equal ones those of this pool first."""
        both = PosePool(
            *(np.concatenate([getattr(self, name), getattr(other, name)]) for name in self.__slots__)
        )
        return both.take(np.argsort(both.cost_mm2, kind="stable"))


@dataclass(frozen=True, slots=True)
class Hypothesis:
    """A pose after a short ICP. normal_sign : -1 when the scan's normals point inwards under it;
    cost_mm2 : truncated point-to-plane cost; source : what it was derived from
    """

    T_design_scan: FloatArray
    normal_sign: float
    cost_mm2: float
    source: Source


@dataclass(frozen=True, slots=True)
class Matching:
    """hypotheses : distinct poses, best first (never empty); design, scan : (k,) indices of the matched
    landmarks;
    T_landmarks : least-squares fit of the matches, None when they do not fix a pose
    """

    hypotheses: tuple[Hypothesis, ...]
    T_landmarks: FloatArray | None
    design: IndexArray
    scan: IndexArray


@dataclass(frozen=True, slots=True)
class PoseCost:
    """cost_mm2 : mean squared distance, truncated at the inlier distance; rmse_mm : untruncated RMS
    distance
    """

    cost_mm2: float
    rmse_mm: float


@dataclass(frozen=True, slots=True)
class Pose:
    """One refined pose.

    cost_mm2, rmse_mm : as in `PoseCost`; occlusion_ratio : share of the scan that the design hides from every
    view; coverage : share of the design that the scan shows; score_mm2 : the cost plus penalties for these
    two, relative to the other poses; normal_sign : -1 when the scan's normals point inwards under it
    """

    T_design_scan: FloatArray
    cost_mm2: float
    rmse_mm: float
    converged: bool
    iterations: int
    occlusion_ratio: float = 0.0
    coverage: float = 1.0
    score_mm2: float = 0.0
    normal_sign: float = 1.0
