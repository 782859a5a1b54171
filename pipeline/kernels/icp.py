"""Iterative closest point (ICP): many poses at once on sampled points, and one pose on the exact surface.

Point-to-plane: Chen & Medioni, "Object modelling by registration of multiple range images" (1992).
Point-to-point: Besl & McKay, "A method for registration of 3-D shapes" (1992). Sums run in a fixed order on
one thread, so the same input gives the same bits.
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from pipeline.core.mesh import FloatArray, IndexArray
from pipeline.kernels import rigid
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
#: Correspondences needed to determine the six unknowns of a motion (derived).
MIN_CORRESPONDENCES = 6


@dataclass(frozen=True, slots=True)
class Target:
    """Samples of the target surface. tree : over `points`; points : (k, 3) mm; normals : (k, 3) unit; target
    frame.
    """

    tree: cKDTree
    points: FloatArray
    normals: FloatArray


@dataclass(frozen=True, slots=True)
class Refined:
    """T_target_source : (4, 4); converged : whether the last step was below the tolerance; iterations : steps
    made.
    """

    T_target_source: FloatArray
    converged: bool
    iterations: int


def step(moved: FloatArray, closest: FloatArray, normals: FloatArray, weights: FloatArray) -> FloatArray:
    """(h, 4, 4) motions that reduce sum w (n . (p - q))^2: one Gauss-Newton step for each of h poses.

    moved : (h, k, 3) source points p in the target frame, mm; closest : (h, k, 3) target points q; normals :
    (h, k, 3) unit normals n at q; weights : (h, k) w >= 0, zero excludes a correspondence. The motion along
    unconstrained degrees of freedom is zero, by damping.
    """
    centre = np.einsum("hk,hkd->hd", weights, moved) / np.maximum(weights.sum(axis=1), 1e-300)[:, None]
    arm = moved - centre[:, None]
    scale = np.sqrt(np.einsum("hk,hkd->h", weights, arm**2) / np.maximum(weights.sum(axis=1), 1e-300))
    scale = np.maximum(scale, 1e-300)  # rotations in units of the RMS radius: a well-scaled 6 x 6 system
    J = np.concatenate([np.cross(arm, normals) / scale[:, None, None], normals], axis=2)
    residual = np.einsum("hkd,hkd->hk", normals, closest - moved)
    A = np.einsum("hk,hki,hkj->hij", weights, J, J)
    b = np.einsum("hk,hki,hk->hi", weights, J, residual)
    damping = DAMPING * np.trace(A, axis1=1, axis2=2)[:, None, None] + 1e-300
    x = np.linalg.solve(A + damping * np.eye(6), b[:, :, None])[:, :, 0]
    x[:, :3] /= scale[:, None]
    T = rigid.from_vector(x)
    # As `rigid.rotation_about`, for many poses at once: the rotation is about `centre`.
    T[:, :3, 3] += centre - np.einsum("hij,hj->hi", T[:, :3, :3], centre)
    return T


def refine_many(
    points: FloatArray,
    normals: FloatArray,
    target: Target,
    T: FloatArray,
    normal_sign: FloatArray,
    *,
    max_distance_mm: float,
    iterations: int,
) -> tuple[FloatArray, FloatArray]:
    """A fixed number of point-to-plane steps from every pose in T.

    points : (k, 3) mm, normals : (k, 3) unit, source frame; T : (h, 4, 4) T_target_source; normal_sign : (h,)
    +1, or -1 to flip the normals of the source under that pose; max_distance_mm : limit of a correspondence

    Returns
    -------
    T : (h, 4, 4); cost : (h,) mm^2, mean squared point-to-plane residual, truncated at max_distance_mm^2. A
    point without a correspondence costs max_distance_mm^2.
    """
    for _ in range(iterations):
        moved, index, weights = _match(points, normals, target, T, normal_sign, max_distance_mm)
        T = step(moved, target.points[index], target.normals[index], weights) @ T
    moved, index, weights = _match(points, normals, target, T, normal_sign, max_distance_mm)
    residual = np.einsum("hkd,hkd->hk", target.normals[index], target.points[index] - moved)
    cost = np.where(weights > 0, np.minimum(residual**2, max_distance_mm**2), max_distance_mm**2)
    return T, cost.mean(axis=1)


def _match(
    points: FloatArray,
    normals: FloatArray,
    target: Target,
    T: FloatArray,
    normal_sign: FloatArray,
    max_distance_mm: float,
) -> tuple[FloatArray, IndexArray, FloatArray]:
    """Moved points (h, k, 3), index of the nearest sample (h, k), and weight (h, k): 1 for a correspondence,
    else 0.
    """
    moved = rigid.transformed(T, points)
    distance, index = target.tree.query(moved, distance_upper_bound=max_distance_mm)
    near = np.isfinite(distance)
    index = np.where(near, index, 0).astype(np.int64)
    rotated = rigid.rotated(T[:, :3, :3], normals) * normal_sign[:, None, None]
    agree = (rotated * target.normals[index]).sum(axis=2) > MIN_AGREEMENT
    return moved, index, (near & agree).astype(np.float64)


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
    """Point-to-plane ICP of `points` to the exact surface. Correspondences beyond `max_distance_mm` are
    excluded.

    points : (k, 3) mm, source frame; normals : (k, 3) unit or None (then any orientation agrees); weights :
    (k,) >= 0; surface : in the target frame; T_target_source : (4, 4) start. The correspondence distance
    starts larger than `max_distance_mm` and shrinks to it, so a coarse start keeps its correspondences. ICP
    has converged when a step moves the points by less than `tolerance_mm` (RMS).
    """
    T = T_target_source
    allowed = START_DISTANCE_FACTOR * max_distance_mm
    for iteration in range(1, max_iterations + 1):
        moved = rigid.transformed(T, points)
        closest = surface.closest(moved)
        w = weights * (closest.distance <= allowed)
        if normals is not None:
            w = w * (np.einsum("kd,kd->k", normals @ T[:3, :3].T, closest.normal) > MIN_AGREEMENT)
        if (w > 0).sum() < MIN_CORRESPONDENCES:
            return Refined(rigid.orthonormal(T), False, iteration)
        increment = step(moved[None], closest.point[None], closest.normal[None], w[None])[0]
        T = increment @ T
        moved_by = rigid.rms_displacement(increment, np.eye(4), moved)
        if allowed == max_distance_mm and moved_by < tolerance_mm:
            return Refined(rigid.orthonormal(T), True, iteration)
        allowed = max(max_distance_mm, DISTANCE_DECAY * allowed)
    return Refined(rigid.orthonormal(T), False, max_iterations)


def complete_shape(
    points: FloatArray, weights: FloatArray, surface: Surface, *, max_iterations: int, tolerance_mm: float
) -> Refined:
    """Point-to-point ICP of the whole shape from the identity, without excluding any point (Besl & McKay
    1992).

    points : (k, 3) mm, in the frame of `surface`; weights : (k,) >= 0
    """
    T = np.eye(4)
    for iteration in range(1, max_iterations + 1):
        moved = rigid.transformed(T, points)
        increment = rigid.fit(moved, surface.closest(moved).point, weights)
        T = increment @ T
        if rigid.rms_displacement(increment, np.eye(4), moved) < tolerance_mm:
            return Refined(rigid.orthonormal(T), True, iteration)
    return Refined(rigid.orthonormal(T), False, max_iterations)
