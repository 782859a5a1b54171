"""What alignments take and give."""

from dataclasses import dataclass, field

import numpy as np

from pipeline.core.brep_faces import BrepFaces
from pipeline.core.mesh import FloatArray, IndexArray, Mesh
from pipeline.core.results import AlignedPoint
from pipeline.inspection.pose_error import PoseError
from pipeline.kernels.surface import Surface
from pipeline.stages.registration import Fit


@dataclass(frozen=True, slots=True, eq=False)
class Placed:
    """A scan on its design. weights : (n,) share of area of each vertex; start : under the automatic pose;
    surface : of the design; segment_of_face : (m,) of it; brep : faces of its CAD model, None where
    it has none; inlier_mm : vertices farther off are not fitted; inflation : as in `patches.median_of`
    """

    scan: Mesh
    weights: FloatArray
    start: Fit
    surface: Surface
    segment_of_face: IndexArray
    brep: BrepFaces | None
    inlier_mm: float
    inflation: float = 1.0


@dataclass(frozen=True, slots=True, eq=False)
class Found:
    """T_design_scan : (4, 4) the alignment; residual_mm, best_fit_residual_mm : RMS of what it makes small,
    under it and under the automatic pose; free : (k, 6) twists about `centre` that it does not determine;
    pose_error : how well it is known, None where that is not told
    """

    T_design_scan: FloatArray
    residual_mm: float
    best_fit_residual_mm: float
    iterations: int
    centre: FloatArray
    free: FloatArray = field(default_factory=lambda: np.zeros((0, 6)))
    points: tuple[AlignedPoint, ...] = ()
    pose_error: PoseError | None = None


class AlignmentFailed(Exception):
    """The scan does not allow the alignment; its text says why. points : as far as they were measured"""

    def __init__(self, reason: str, points: tuple[AlignedPoint, ...] = ()) -> None:
        self.points = points
        super().__init__(reason)
