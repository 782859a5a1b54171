"""Unconstrained degrees of freedom: small motions of a registered scan that barely change the fit to its
design.

Examples are the rotation of a bolt about its axis and the translation along a rail. The analysis uses the
6 x 6 point-to-plane Hessian at the area centroid, with rotations scaled by the RMS radius so that all six
unknowns are displacements in mm (Bonnabel, Barczyk, Goulette, "On the covariance of ICP-based
scan-matching techniques", 2016; their closed form holds for point-to-plane only). The standard deviation
of a motion is sigma / sqrt(n_eff lambda), where n_eff is the number of independent residuals.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from pipeline.core.mesh import FloatArray
from pipeline.kernels import rigid
from pipeline.kernels.patches import patch_means

#: Max number of independent residuals: warp and calibration errors are correlated over the whole scan.
#: Chosen by hand; not fitted.
MAX_EFFECTIVE_COUNT = 300
#: Min number of independent residuals: six unknowns need six (derived).
MIN_EFFECTIVE_COUNT = 6.0
#: The noise is at least `limit_mm` over this: even a copy without noise has an uncertainty. Chosen by
#: hand; not fitted.
NOISE_FLOOR_DIVISOR = 50.0
#: Second step length over the limit: long enough to leave a facet of a tessellated surface. Chosen by
#: hand; not fitted.
WIDE_STEP_FACTOR = 10.0
#: Displacement of the other motions over the step of the weak motion, in `lowest`. Chosen by hand; not
#: fitted.
ASIDE_SHARE = 0.05
#: Max displacement of the other motions, in units of `ASIDE_SHARE` times the step. Chosen by hand; not
#: fitted.
MAX_ASIDE_STEPS = 4.0
#: Max cosine between the weak motion and one that counts as another motion. Chosen by hand; not fitted.
SAME_MOTION_COS = 0.5
#: Eigenvalues (dimensionless) above this are not verified with finite steps. Chosen by hand; not fitted.
VERIFY_BELOW = 0.02
#: Min curvature (dimensionless) in the standard deviation, against division by zero. Chosen by hand.
MIN_CURVATURE = 1e-12
#: Max standard deviation in RMS radii; larger values have no meaning. Chosen by hand.
MAX_SIGMA_RADII = 10
#: A motion whose translation (or rotation), in mm, is below this share of the other is a pure rotation (or
#: translation). Chosen by hand; not fitted.
PURE_SHARE = 0.15


@dataclass(frozen=True, slots=True)
class Motion:
    """One unconstrained motion, in the design frame.

    axis : (3,) unit, of the rotation or along the translation; point_mm : (3,) on the axis (the centroid
    for a translation); sigma_mm : standard deviation of the RMS displacement; twist : (6,) rotation vector
    (radians) and translation (mm) about the centroid, for each mm of displacement
    """

    kind: Literal["rotation", "translation", "screw"]
    axis: FloatArray
    point_mm: FloatArray
    sigma_mm: float
    twist: FloatArray


@dataclass(frozen=True, slots=True)
class Observability:
    """eigenvalues : (6,) ascending, dimensionless, sum about 2; unconstrained : motions with sigma above
    the limit.
    """

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
    """Eigenvalues of the Hessian and the unconstrained degrees of freedom of a registered scan.

    points : (k, 3) mm, registered scan, design frame; normals : (k, 3) unit, of the design at the closest
    points; residual_mm : (k,) signed; weights : (k,) >= 0, 0 excludes a point; limit_mm : a motion with a
    larger standard deviation is unconstrained; cost_mm2 : mean squared distance after one more motion (4,
    4).

    The facets of a tessellated bolt resist a very small rotation, the bolt itself does not. So a weak
    motion is also made with finite steps, by the limit and by ten times the limit in both directions. The
    measured increase of the cost replaces the eigenvalue where it is smaller.
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
    centre = np.einsum("k,kd->d", w, points)  # not by BLAS, which splits sums among threads
    arm = points - centre
    radius = max(float(np.sqrt((w * (arm**2).sum(axis=1)).sum())), 1e-300)
    J = np.concatenate([np.cross(arm, normals) / radius, normals], axis=1)
    hessian = np.einsum("k,ki,kj->ij", w, J, J)
    eigenvalues, vectors = np.linalg.eigh(hessian)
    variance = max(float((w * residual**2).sum()), (limit_mm / NOISE_FLOOR_DIVISOR) ** 2) / effective_count(
        points, residual, w
    )

    def curvature_along(vector: FloatArray) -> float:
        """Increase of the cost over the squared step along a unit `vector` (6,): dimensionless, like an
        eigenvalue.
        """
        linear = float(vector @ hessian @ vector)
        if linear > VERIFY_BELOW:
            return linear
        for step_mm in (limit_mm, WIDE_STEP_FACTOR * limit_mm):
            at_rest, *moved = (
                lowest(vector, side * step_mm, ASIDE_SHARE * step_mm) for side in (0.0, 1.0, -1.0)
            )
            linear = min(linear, max(0.0, sum(moved) / 2 - at_rest) / step_mm**2)
        return linear

    def after(motion_mm: FloatArray) -> float:
        return cost_mm2(motion_about(centre, np.concatenate([motion_mm[:3] / radius, motion_mm[3:]])))

    def lowest(vector: FloatArray, step_mm: float, aside_mm: float) -> float:
        """The cost after `step_mm` along `vector`, minimised over the other motions.

        Facets couple the motions. Over a long step this coupling costs more than the resistance of the
        part itself.
        """
        made, cost = step_mm * vector, after(step_mm * vector)
        for other in vectors.T:
            if abs(float(other @ vector)) > SAME_MOTION_COS:
                continue
            more, less = after(made + aside_mm * other), after(made - aside_mm * other)
            bend = more + less - 2 * cost
            if bend <= 0:
                continue
            best = (
                made
                + float(np.clip((less - more) / (2 * bend), -MAX_ASIDE_STEPS, MAX_ASIDE_STEPS))
                * aside_mm
                * other
            )
            if (lower := after(best)) < cost:
                made, cost = best, lower
        return cost

    def sigma_mm(vector: FloatArray) -> float:
        return float(
            min(np.sqrt(variance / max(curvature_along(vector), MIN_CURVATURE)), MAX_SIGMA_RADII * radius)
        )

    weak = vectors[:, [sigma_mm(vector) > limit_mm for vector in vectors.T]]
    motions = tuple(_motion(each, sigma_mm(each), centre, radius) for each in _separate_translations(weak).T)
    return Observability(np.maximum(eigenvalues, 0.0), motions)


def motion_about(centre: FloatArray, twist: FloatArray) -> FloatArray:
    """(4, 4) the motion of `twist` (6,), rotation vector (radians) and translation (mm), about `centre`
    (3,).
    """
    T = rigid.from_vector(twist[None])[0]
    return rigid.rotation_about(T[:3, :3], centre, T[:3, 3] + centre)


def effective_count(points: FloatArray, residual_mm: FloatArray, weights: FloatArray) -> float:
    """Number of independent residuals, from the variance of patch means over the variance of single
    residuals.

    points : (k, 3) mm; residual_mm : (k,); weights : (k,), sum 1. Independent residuals average out within
    a patch; fully correlated residuals do not, and then each patch counts as one.
    """
    total = float((weights * residual_mm**2).sum())
    if total <= 0:
        return float(min(MAX_EFFECTIVE_COUNT, len(points)))
    share, mean = patch_means(points, residual_mm, weights)
    between = float(share @ mean**2)
    return float(
        np.clip(
            len(share) * total / max(between, 1e-300),
            MIN_EFFECTIVE_COUNT,
            min(MAX_EFFECTIVE_COUNT, len(points)),
        )
    )


def _separate_translations(motions: FloatArray) -> FloatArray:
    """(6, m) an orthonormal basis of the same motions in which pure translations are separate."""
    if motions.shape[1] < 2:
        return motions
    _, turning, mix = np.linalg.svd(motions[:3])
    order = np.argsort(
        np.concatenate([turning, np.zeros(max(0, motions.shape[1] - 3))])[: motions.shape[1]], kind="stable"
    )
    return np.asarray(motions @ mix.T[:, order], dtype=np.float64)


def _motion(vector: FloatArray, sigma_mm: float, centre: FloatArray, radius: float) -> Motion:
    turn, slide = vector[:3], vector[3:]
    turned, slid = float(np.linalg.norm(turn)), float(np.linalg.norm(slide))
    twist = np.concatenate([turn / radius, slide])
    if turned < PURE_SHARE * slid:
        return Motion("translation", _signed(slide / slid), centre, sigma_mm, twist)
    omega = turn / radius
    along = float(slide @ turn) / turned
    point = centre + np.cross(omega, slide) / float(omega @ omega)
    kind: Literal["rotation", "screw"] = "rotation" if abs(along) < PURE_SHARE * turned else "screw"
    return Motion(kind, _signed(turn / turned), point, sigma_mm, twist)


def _signed(axis: FloatArray) -> FloatArray:
    """The axis with its largest component positive: an axis has no direction."""
    return np.asarray(axis * np.sign(axis[int(np.abs(axis).argmax())]), dtype=np.float64)
