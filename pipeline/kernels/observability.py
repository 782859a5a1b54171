"""Which small motions of a registered scan its design does not notice: turning a bolt, sliding along a rail.

The 6 x 6 point-to-plane Hessian at the area centroid, rotations scaled by the RMS radius so that all six unknowns are
displacements in mm (Bonnabel, Barczyk, Goulette, "On the covariance of ICP-based scan-matching techniques", 2016: its
closed form holds for point-to-plane only). The standard deviation of a motion is sigma / sqrt(n_eff lambda), with as many
effective samples as the residuals' correlation leaves.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from pipeline.core.mesh import FloatArray
from pipeline.kernels import rigid
from pipeline.kernels.patches import patch_means

MOST_EFFECTIVE = (
    300  # warp and calibration correlate everywhere: thousands of points never are so many samples
)
LEAST_NOISE = 50.0
WIDE = 10.0  # times the limit: a facet is soon left behind
ASIDE = 0.05  # of the step of a weak motion: how far the others are tried
WEAK = 0.02  # eigenvalues above this need no second look
_PURE = (
    0.15  # of a motion in mm: less than this share of the other kind, and it is a rotation or a translation
)


@dataclass(frozen=True, slots=True)
class Motion:
    """axis : (3,) unit, of the rotation or along the translation; point_mm : (3,) on the axis (the centroid for a
    translation); sigma_mm : standard deviation of the RMS displacement; twist : (6,) rotation vector a mm of displacement
    and translation, about the centroid
    """

    kind: Literal["rotation", "translation", "screw"]
    axis: FloatArray
    point_mm: FloatArray
    sigma_mm: float
    twist: FloatArray


@dataclass(frozen=True, slots=True)
class Observability:
    """eigenvalues : (6,) ascending, pure numbers that sum to about 2; unconstrained : motions with sigma above the limit"""

    eigenvalues: FloatArray
    unconstrained: tuple[Motion, ...]


def observe(
    points: FloatArray,
    normals: FloatArray,
    residual_mm: FloatArray,
    weights: FloatArray,
    limit_mm: float,
    cost_mm2: Callable[[FloatArray], float],
) -> Observability:
    """points : (k, 3) of the scan in place; normals : (k, 3) of the design there; residual_mm : (k,) signed;
    weights : (k,), 0 leaves a point out; limit_mm : motions less certain than this (one sigma) are free;
    cost_mm2 : mean squared distance after one more motion (4, 4).

    The facets of a tessellated bolt notice the first micrometre of a turn, the bolt does not: a weak motion is also made,
    by the limit and by ten times that to either side, and what the cost really rises by counts where it is less.
    """
    kept = weights > 0
    if kept.sum() < 6:
        return Observability(np.zeros(6), ())
    points, normals, residual, w = (
        points[kept],
        normals[kept],
        residual_mm[kept],
        weights[kept] / weights[kept].sum(),
    )
    centre = np.einsum("k,kd->d", w, points)  # like every sum here not by BLAS, which splits it among threads
    arm = points - centre
    radius = max(float(np.sqrt((w * (arm**2).sum(axis=1)).sum())), 1e-300)
    J = np.concatenate([np.cross(arm, normals) / radius, normals], axis=1)
    hessian = np.einsum("k,ki,kj->ij", w, J, J)
    eigenvalues, vectors = np.linalg.eigh(hessian)
    # nothing is known better than a fiftieth of what is asked for: not even a copy without noise
    variance = max(float((w * residual**2).sum()), (limit_mm / LEAST_NOISE) ** 2) / effective_count(
        points, residual, w
    )

    def curvature_along(vector: FloatArray) -> float:
        """How fast the cost rises along a unit vector of the six, in units of its square."""
        linear = float(vector @ hessian @ vector)
        if linear > WEAK:
            return linear
        for step_mm in (limit_mm, WIDE * limit_mm):
            at_rest, *moved = (lowest(vector, side * step_mm, ASIDE * step_mm) for side in (0.0, 1.0, -1.0))
            linear = min(linear, max(0.0, sum(moved) / 2 - at_rest) / step_mm**2)
        return linear

    def after(motion_mm: FloatArray) -> float:
        return cost_mm2(motion_about(centre, np.concatenate([motion_mm[:3] / radius, motion_mm[3:]])))

    def lowest(vector: FloatArray, step_mm: float, aside_mm: float) -> float:
        """The cost after so much of the motion, the others let go: facets mix a little of them into it, which over a wide
        step is more than the part itself resists.
        """
        made, cost = step_mm * vector, after(step_mm * vector)
        for other in vectors.T:
            if abs(float(other @ vector)) > 0.5:
                continue
            more, less = after(made + aside_mm * other), after(made - aside_mm * other)
            bend = more + less - 2 * cost
            if bend <= 0:
                continue
            best = made + float(np.clip((less - more) / (2 * bend), -4.0, 4.0)) * aside_mm * other
            if (lower := after(best)) < cost:
                made, cost = best, lower
        return cost

    def sigma_mm(vector: FloatArray) -> float:
        return float(min(np.sqrt(variance / max(curvature_along(vector), 1e-12)), 10 * radius))

    free = vectors[:, [sigma_mm(vector) > limit_mm for vector in vectors.T]]
    motions = tuple(_motion(each, sigma_mm(each), centre, radius) for each in _untangled(free).T)
    return Observability(np.maximum(eigenvalues, 0.0), motions)


def motion_about(centre: FloatArray, twist: FloatArray) -> FloatArray:
    """(4, 4) the motion of a twist (6,), rotation vector and translation, about a point."""
    T = rigid.from_vector(twist[None])[0]
    return rigid.rotation_about(T[:3, :3], centre, T[:3, 3] + centre)


def effective_count(points: FloatArray, residual_mm: FloatArray, weights: FloatArray) -> float:
    """So many independent residuals scatter as these do: patches of the surface whose means vary less than single
    residuals hold independent ones, patches whose means vary as much hold one each. At least 6, at most 300.
    """
    total = float((weights * residual_mm**2).sum())
    if total <= 0:
        return float(min(MOST_EFFECTIVE, len(points)))
    share, mean = patch_means(points, residual_mm, weights)
    between = float(share @ mean**2)
    return float(np.clip(len(share) * total / max(between, 1e-300), 6.0, min(MOST_EFFECTIVE, len(points))))


def _untangled(free: FloatArray) -> FloatArray:
    """(6, m) an orthonormal basis of the same free motions in which translations stand alone."""
    if free.shape[1] < 2:
        return free
    _, turning, mix = np.linalg.svd(free[:3])
    order = np.argsort(
        np.concatenate([turning, np.zeros(max(0, free.shape[1] - 3))])[: free.shape[1]], kind="stable"
    )
    return np.asarray(free @ mix.T[:, order], dtype=np.float64)


def _motion(vector: FloatArray, sigma_mm: float, centre: FloatArray, radius: float) -> Motion:
    turn, slide = vector[:3], vector[3:]
    turned, slid = float(np.linalg.norm(turn)), float(np.linalg.norm(slide))
    twist = np.concatenate([turn / radius, slide])
    if turned < _PURE * slid:
        return Motion("translation", _signed(slide / slid), centre, sigma_mm, twist)
    omega = turn / radius
    along = float(slide @ turn) / turned
    point = centre + np.cross(omega, slide) / float(omega @ omega)
    kind: Literal["rotation", "screw"] = "rotation" if abs(along) < _PURE * turned else "screw"
    return Motion(kind, _signed(turn / turned), point, sigma_mm, twist)


def _signed(axis: FloatArray) -> FloatArray:
    """An axis has no direction: the largest component is positive."""
    return np.asarray(axis * np.sign(axis[int(np.abs(axis).argmax())]), dtype=np.float64)
