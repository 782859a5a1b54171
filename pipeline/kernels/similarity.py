"""How much larger one shape is than another, where they already lie on each other, and what is bent: a diagnosis, never
applied.
"""

from dataclasses import dataclass

import numpy as np

from pipeline.core.mesh import FloatArray
from pipeline.kernels import rigid
from pipeline.kernels.patches import patch_means
from pipeline.kernels.surface import Surface

_ITERATIONS = 12
_WEAK = 1e-6  # an eigenvalue below this: the surface cannot tell (a plane has no size)


@dataclass(frozen=True, slots=True)
class ScaleEstimate:
    """factors : (1,) isotropic or (3,) along the target's axes, size of the source over that of the target: 0.996 for a
    print 0.4 % too small; residual_mm : (k,) signed distance along the target's normal that is left; point : (k, 3)
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
    """Point-to-plane Gauss-Newton over rotation, translation and scale from the final pose.

    points : (k, 3) of the source; matches beyond `max_distance_mm` are left out. None where the surface cannot tell.
    """
    placed = rigid.transformed(T_target_source, points)
    grown = np.ones(3 if per_axis else 1)
    T = np.eye(4)
    centre = np.einsum("k,kd->d", weights, placed) / weights.sum()
    about = placed - centre
    for _ in range(_ITERATIONS):
        # the scale acts along the target's axes, about the centre; then a small rigid motion
        moved = rigid.transformed(T, centre + about * grown)
        found = surface.closest(moved)
        w = weights * (found.distance <= max_distance_mm)
        if (w > 0).sum() < 6 + len(grown):
            return None
        arm = moved - centre
        radius = float(np.sqrt((w * (arm**2).sum(axis=1)).sum() / w.sum()))
        along = arm * found.normal / radius
        columns = along if per_axis else along.sum(axis=1, keepdims=True)
        J = np.column_stack([np.cross(arm, found.normal) / radius, found.normal, columns])
        residual = (found.normal * (found.point - moved)).sum(axis=1)
        A = np.einsum("k,ki,kj->ij", w, J, J) / w.sum()
        if np.linalg.eigvalsh(A)[0] < _WEAK:
            return None
        x = np.linalg.solve(A, np.einsum("k,ki,k->i", w, J, residual) / w.sum())
        grown = grown * (1.0 + x[6:] / radius)
        small = rigid.from_vector(np.concatenate([x[:3] / radius, x[3:6]])[None])[0]
        step = rigid.rotation_about(small[:3, :3], centre, small[:3, 3] + centre)
        T = step @ T
    return ScaleEstimate(1.0 / grown, np.where(w > 0, -residual, 0.0), found.point)


def residual_deformation_mm(estimate: ScaleEstimate, weights: FloatArray) -> float:
    """RMS over patches of the surface of the mean signed distance that is left after scaling: what is bent, not rough.

    weights : (k,) of the points of `estimate`; some hundred patches, so that noise averages out and long waves stay.
    """
    share, mean = patch_means(estimate.point, estimate.residual_mm, weights)
    return float(np.sqrt(share @ mean**2 / share.sum()))
