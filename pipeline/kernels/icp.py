"""Iterative closest point (ICP): many poses at once on sampled points, and one pose on the exact surface.

Point-to-plane: Chen & Medioni, "Object modelling by registration of multiple range images" (1992).
Point-to-point: Besl & McKay, "A method for registration of 3-D shapes" (1992). The loops are in
`native/icp.cpp`; the sums of a pose run in a fixed order, so the same input gives the same bits with any
number of threads.
"""

import os
from dataclasses import dataclass

import numpy as np

from pipeline.core.mesh import FloatArray
from pipeline.kernels import rigid
from pipeline.kernels.native import core
from pipeline.kernels.surface import Surface

#: Min cosine of the angle between the normals of a correspondence (60 degrees). A larger angle means another
#: side of the part. Chosen by hand; not fitted.
MIN_AGREEMENT = 0.5
#: Levenberg damping of the normal equations over their trace: keeps unconstrained motions at zero. Chosen by
#: hand.
DAMPING = 1e-9
#: Correspondence distance at the start over the final one. Chosen by hand; not fitted.
START_DISTANCE_FACTOR = 3.0
#: Factor by which the correspondence distance shrinks in each iteration. Chosen by hand; not fitted.
DISTANCE_DECAY = 0.6
#: ICP has also converged when the cost has not fallen by this share in so many iterations: along a motion
#: that the surface does not hold (a sphere), noise moves the points for ever. The cost itself is known to a
#: hundredth only (1 / sqrt of the number of points). Chosen by hand; not fitted.
STALL_SHARE, STALL_ITERATIONS = 1e-4, 8
#: Correspondences needed to determine the six unknowns of a motion (derived).
MIN_CORRESPONDENCES = 6


@dataclass(frozen=True, slots=True)
class Refined:
    """T_target_source : (4, 4); converged : whether the last step was below the tolerance, or the cost no
    longer fell; iterations : steps made.
    """

    T_target_source: FloatArray
    converged: bool
    iterations: int


class Target:
    """Samples of the target surface. points : (k, 3) mm; normals : (k, 3) unit; target frame."""

    def __init__(self, points: FloatArray, normals: FloatArray) -> None:
        self._core = core.SampleTarget(_rows(points), _rows(normals))

    def refine_many(
        self,
        points: FloatArray,
        normals: FloatArray,
        T: FloatArray,
        normal_sign: FloatArray,
        *,
        max_distance_mm: float,
        iterations: int,
    ) -> tuple[FloatArray, FloatArray]:
        """A fixed number of point-to-plane steps from every pose in T.

        points : (k, 3) mm, normals : (k, 3) unit, source frame; T : (h, 4, 4) T_target_source; normal_sign :
        (h,) +1, or -1 to flip the normals of the source under that pose; max_distance_mm : limit of a
        correspondence

        Returns
        -------
        T : (h, 4, 4); cost : (h,) mm^2, mean squared point-to-plane residual, truncated at
        max_distance_mm^2. A point without a correspondence costs max_distance_mm^2.
        """
        refined, cost = self._core.refine(
            _rows(points),
            _rows(normals),
            np.ascontiguousarray(T),
            np.ascontiguousarray(normal_sign),
            max_distance=max_distance_mm,
            min_agreement=MIN_AGREEMENT,
            damping=DAMPING,
            iterations=iterations,
            threads=len(os.sched_getaffinity(0)),
        )
        return np.asarray(refined), np.asarray(cost)


def refine(
    points: FloatArray,
    normals: FloatArray | None,
    weights: FloatArray,
    surface: Surface,
    T_target_source: FloatArray,
    *,
    max_distance_mm: float,
    max_iterations: int,
    tolerance_mm: float,
) -> Refined:
    """`refine_all` from one pose (4, 4)."""
    (refined,) = refine_all(
        *(points, normals, weights, surface, T_target_source[None], np.ones(1)),
        max_distance_mm=max_distance_mm,
        max_iterations=max_iterations,
        tolerance_mm=tolerance_mm,
    )
    return refined


def refine_all(
    points: FloatArray,
    normals: FloatArray | None,
    weights: FloatArray,
    surface: Surface,
    T: FloatArray,
    normal_sign: FloatArray,
    *,
    max_distance_mm: float,
    max_iterations: int,
    tolerance_mm: float,
) -> list[Refined]:
    """Point-to-plane ICP of `points` to the exact surface, from each pose in T. Correspondences beyond
    `max_distance_mm` are excluded.

    points : (k, 3) mm, source frame; normals : (k, 3) unit or None (then any orientation agrees); weights :
    (k,) >= 0; surface : in the target frame; T : (h, 4, 4) T_target_source; normal_sign : (h,) +1, or -1 to
    flip the normals under that pose. The correspondence distance starts larger than `max_distance_mm` and
    shrinks to it, so a coarse start keeps its correspondences. ICP has converged when a step moves the points
    by less than `tolerance_mm` (RMS), or when the cost no longer falls (`STALL_SHARE`).
    """
    refined, converged, iterations = surface.target.refine(
        _rows(points),
        None if normals is None else _rows(normals),
        np.ascontiguousarray(weights),
        np.ascontiguousarray(T),
        np.ascontiguousarray(normal_sign),
        max_distance=max_distance_mm,
        start_factor=START_DISTANCE_FACTOR,
        decay=DISTANCE_DECAY,
        min_agreement=MIN_AGREEMENT,
        damping=DAMPING,
        min_pairs=MIN_CORRESPONDENCES,
        iterations=max_iterations,
        tolerance=tolerance_mm,
        stall_share=STALL_SHARE,
        stall_iterations=STALL_ITERATIONS,
        threads=len(os.sched_getaffinity(0)),
    )
    return [
        Refined(rigid.orthonormal(each), bool(is_converged), int(steps))
        for each, is_converged, steps in zip(np.asarray(refined), converged, iterations, strict=True)
    ]


def complete_shape(
    points: FloatArray, weights: FloatArray, surface: Surface, *, max_iterations: int, tolerance_mm: float
) -> Refined:
    """Point-to-point ICP of the whole shape from the identity, without excluding any point (Besl & McKay
    1992).

    points : (k, 3) mm, in the frame of `surface`; weights : (k,) >= 0
    """
    T, converged, iterations = surface.target.complete(
        _rows(points), np.ascontiguousarray(weights), max_iterations, tolerance_mm
    )
    return Refined(rigid.orthonormal(np.asarray(T)[0]), bool(converged), int(iterations))


def _rows(values: FloatArray) -> FloatArray:
    return np.ascontiguousarray(values, dtype=np.float64)
