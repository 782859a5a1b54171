"""Scale and deformation of a registered scan relative to its design: a diagnosis; the scan is never
scaled.
"""

from dataclasses import dataclass

import numpy as np

from pipeline.core.mesh import FloatArray
from pipeline.kernels import rigid
from pipeline.kernels.patches import patch_means
from pipeline.kernels.surface import Surface

#: Gauss-Newton iterations on few points, at most, and then on all of them. Chosen by hand; not fitted.
ITERATIONS, FINAL_ITERATIONS = 12, 3
#: Every so many points are the few. Chosen by hand; not fitted.
COARSE_STEP = 4
#: A step that changes the factors, and moves the points relative to their radius, by less than this ends it:
#: a tenth of the last digit that a report shows of a factor. Chosen by hand; not fitted.
CONVERGENCE = 1e-5
#: Min eigenvalue (dimensionless) of the normal equations. Below it the surface does not determine the
#: scale, as with a plane. Chosen by hand; not fitted.
MIN_EIGENVALUE = 1e-6


@dataclass(frozen=True, slots=True)
class ScaleEstimate:
    """Size of the source over that of the target, and what scaling does not explain.

    factors : (1,) isotropic or (3,) along the target's coordinate axes; 0.996 for a print 0.4 % too small;
    residual_mm : (k,) signed distance along the target's normal after scaling, 0 for excluded points;
    point : (k, 3) mm, closest points, target frame
    """

    factors: FloatArray
    residual_mm: FloatArray
    point: FloatArray


def estimate_scale(
    points: FloatArray,
    weights: FloatArray,
    surface: Surface,
    T_target_source: FloatArray,
    max_distance_mm: float,
    *,
    per_axis: bool,
) -> ScaleEstimate | None:
    """Point-to-plane Gauss-Newton over rotation, translation and scale, from the final pose; most of the way
    on every `COARSE_STEP`-th point.

    points : (k, 3) mm, source frame; weights : (k,) >= 0; surface : in the target frame; T_target_source :
    (4, 4); per_axis : three factors along the target's axes instead of one. Correspondences beyond
    `max_distance_mm` are excluded. None if the surface does not determine the scale.
    """
    placed = rigid.transformed(T_target_source, points)
    centre = np.einsum("k,kd->d", weights, placed) / weights.sum()
    scale, T = np.ones(3 if per_axis else 1), np.eye(4)
    for step, iterations in ((COARSE_STEP, ITERATIONS), (1, FINAL_ITERATIONS)):
        fitted = _fit(
            placed[::step] - centre, weights[::step], surface, max_distance_mm, centre, scale, T, iterations
        )
        if fitted is None:
            return None
        scale, T, residual_mm, point = fitted
    return ScaleEstimate(1.0 / scale, residual_mm, point)


def _fit(
    offset: FloatArray,
    weights: FloatArray,
    surface: Surface,
    max_distance_mm: float,
    centre: FloatArray,
    scale: FloatArray,
    T: FloatArray,
    iterations: int,
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray] | None:
    """scale and T after at most `iterations` steps, residuals (k,) and closest points (k, 3) as in
    `ScaleEstimate`. offset : (k, 3) mm, points from `centre`
    """
    near = None
    for _ in range(iterations):
        # the scale acts along the target's axes, about the centre; then a small rigid motion
        moved = rigid.transformed(T, centre + offset * scale)
        closest = surface.closest(moved, near)
        near = closest.face
        w = weights * (closest.distance <= max_distance_mm)
        if (w > 0).sum() < 6 + len(scale):
            return None
        arm = moved - centre
        radius = float(np.sqrt((w * (arm**2).sum(axis=1)).sum() / w.sum()))
        along = arm * closest.normal / radius
        columns = along if len(scale) == 3 else along.sum(axis=1, keepdims=True)
        J = np.column_stack([np.cross(arm, closest.normal) / radius, closest.normal, columns])
        residual = (closest.normal * (closest.point - moved)).sum(axis=1)
        A = np.einsum("ki,kj->ij", w[:, None] * J, J) / w.sum()
        if np.linalg.eigvalsh(A)[0] < MIN_EIGENVALUE:
            return None
        x = np.linalg.solve(A, np.einsum("k,ki,k->i", w, J, residual) / w.sum())
        scale = scale * (1.0 + x[6:] / radius)
        small = rigid.from_vector(np.concatenate([x[:3] / radius, x[3:6]])[None])[0]
        step = rigid.rotation_about(small[:3, :3], centre, small[:3, 3] + centre)
        T = step @ T
        if np.abs(x).max() < CONVERGENCE * radius:
            break
    return scale, T, np.where(w > 0, -residual, 0.0), closest.point


def residual_deformation_mm(estimate: ScaleEstimate, weights: FloatArray) -> float:
    """RMS in mm of the patch means of the signed distance after scaling: bending and warping, without
    roughness.

    weights : (k,) >= 0 of the points of `estimate`. Means over about 100 patches remove noise and keep
    long waves.
    """
    share, mean = patch_means(estimate.point, estimate.residual_mm, weights)
    return float(np.sqrt(share @ mean**2 / share.sum()))
