"""Iterative closest point, point to plane: many poses at once on samples, one pose on the exact surface.

Chen & Medioni, "Object modelling by registration of multiple range images" (1992). Sums run in a fixed order on one
thread, so the same input gives the same bits.
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from pipeline.core.mesh import FloatArray, IndexArray
from pipeline.kernels import rigid
from pipeline.kernels.surface import Surface

MIN_AGREEMENT = 0.5  # cosine: a match whose normals differ by more than 60 degrees is of another side


@dataclass(frozen=True, slots=True)
class Target:
    """A design sampled for fast look-up: tree over points (k, 3), unit normals (k, 3)."""

    tree: cKDTree
    points: FloatArray
    normals: FloatArray


@dataclass(frozen=True, slots=True)
class Refined:
    """T_target_source : (4, 4); converged; iterations that were run"""

    T_target_source: FloatArray
    converged: bool
    iterations: int


def step(moved: FloatArray, closest: FloatArray, normals: FloatArray, weights: FloatArray) -> FloatArray:
    """(h, 4, 4) motions that lessen sum w (n . (p - q))^2, one Gauss-Newton step each.

    moved, closest, normals : (h, k, 3); weights : (h, k), zero leaves a match out. Free motions get none.
    """
    centre = np.einsum("hk,hkd->hd", weights, moved) / np.maximum(weights.sum(axis=1), 1e-300)[:, None]
    arm = moved - centre[:, None]
    scale = np.sqrt(np.einsum("hk,hkd->h", weights, arm**2) / np.maximum(weights.sum(axis=1), 1e-300))
    scale = np.maximum(scale, 1e-300)  # rotations in units of the part's radius: a well-scaled 6 x 6
    J = np.concatenate([np.cross(arm, normals) / scale[:, None, None], normals], axis=2)
    residual = np.einsum("hkd,hkd->hk", normals, closest - moved)
    A = np.einsum("hk,hki,hkj->hij", weights, J, J)
    b = np.einsum("hk,hki,hk->hi", weights, J, residual)
    damping = 1e-9 * np.trace(A, axis1=1, axis2=2)[:, None, None] + 1e-300
    x = np.linalg.solve(A + damping * np.eye(6), b[:, :, None])[:, :, 0]
    x[:, :3] /= scale[:, None]
    about = rigid.from_vector(x)  # turns about `centre`
    about[:, :3, 3] += centre - np.einsum("hij,hj->hi", about[:, :3, :3], centre)
    return about


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
    """A short ICP of `points` (k, 3) from every pose in T (h, 4, 4).

    normal_sign : (h,) +1, or -1 to turn the normals of the points over under that pose

    Returns
    -------
    T : (h, 4, 4); cost : (h,) mean over the points of the squared point-to-plane residual, truncated at
    max_distance_mm^2, which is also the cost of a point without a match of agreeing normal
    """
    for _ in range(iterations):
        moved, found, weights = _match(points, normals, target, T, normal_sign, max_distance_mm)
        T = step(moved, target.points[found], target.normals[found], weights) @ T
    moved, found, weights = _match(points, normals, target, T, normal_sign, max_distance_mm)
    residual = np.einsum("hkd,hkd->hk", target.normals[found], target.points[found] - moved)
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
    """Points in place (h, k, 3), number of the nearest sample (h, k), weight (h, k): 1 where near and agreeing."""
    moved = rigid.transformed(T, points)
    distance, found = target.tree.query(moved, distance_upper_bound=max_distance_mm)
    near = np.isfinite(distance)
    found = np.where(near, found, 0).astype(np.int64)
    rotated = rigid.rotated(T[:, :3, :3], normals) * normal_sign[:, None, None]
    agree = (rotated * target.normals[found]).sum(axis=2) > MIN_AGREEMENT
    return moved, found, (near & agree).astype(np.float64)


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
    """ICP of `points` (k, 3) to the exact surface; matches beyond `max_distance_mm` are left out.

    The allowed distance starts at three times the final one and shrinks, so that a coarse start is not cut off.
    Converged when a step moves the points by less than `tolerance_mm` (RMS).
    """
    T = T_target_source
    allowed = 3.0 * max_distance_mm
    for iteration in range(1, max_iterations + 1):
        moved = rigid.transformed(T, points)
        found = surface.closest(moved)
        w = weights * (found.distance <= allowed)
        if normals is not None:
            w = w * (np.einsum("kd,kd->k", normals @ T[:3, :3].T, found.normal) > MIN_AGREEMENT)
        if (w > 0).sum() < 6:
            return Refined(rigid.orthonormal(T), False, iteration)
        increment = step(moved[None], found.point[None], found.normal[None], w[None])[0]
        T = increment @ T
        moved_by = rigid.rms_displacement(increment, np.eye(4), moved)
        if allowed == max_distance_mm and moved_by < tolerance_mm:
            return Refined(rigid.orthonormal(T), True, iteration)
        allowed = max(max_distance_mm, 0.6 * allowed)
    return Refined(rigid.orthonormal(T), False, max_iterations)


def complete_shape(
    points: FloatArray, weights: FloatArray, surface: Surface, *, max_iterations: int, tolerance_mm: float
) -> Refined:
    """Plain ICP of the whole shape from where it is, point to point, nothing left out (Besl & McKay 1992)."""
    T = np.eye(4)
    for iteration in range(1, max_iterations + 1):
        moved = rigid.transformed(T, points)
        increment = rigid.fit(moved, surface.closest(moved).point, weights)
        T = increment @ T
        if rigid.rms_displacement(increment, np.eye(4), moved) < tolerance_mm:
            return Refined(rigid.orthonormal(T), True, iteration)
    return Refined(rigid.orthonormal(T), False, max_iterations)
