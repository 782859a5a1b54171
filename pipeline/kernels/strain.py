"""Uniform strain of a registered surface: how much longer it is along some direction than its target, and how
much larger, beside a rigid motion.

Point-to-plane Gauss-Newton over twelve unknowns, a rotation w, a translation t and a symmetric strain E,

    r_k = n_k . (q_k - p_k) ~ n_k . (w x a_k + t + E a_k),     a_k = p_k - centre,

from the final pose. Surfaces leave some of E undetermined (a plane, its thickness): a weak prior about no
strain decides there. The principal strains are the same in every frame.
"""

from dataclasses import dataclass

import numpy as np

from pipeline.core.mesh import FloatArray
from pipeline.kernels import rigid
from pipeline.kernels.patches import PATCHES, patch_means
from pipeline.kernels.surface import Surface

#: Gauss-Newton iterations, at most, and the step relative to the radius that ends them. Chosen by hand.
ITERATIONS, CONVERGENCE = 8, 1e-5
#: Standard deviation of a strain before anything is seen. Chosen by hand: far above what is looked for.
PRIOR = 0.1
#: Of the largest diagonal element; a sphere does not determine its rotation. Rounding.
DAMPING = 1e-9
#: Fewer points do not carry twelve unknowns. Chosen by hand.
MIN_POINTS = 100


@dataclass(frozen=True, slots=True)
class Strain:
    """principal : (3,) ascending, size of the source over that of the target minus 1, along the columns of
    axes : (3, 3), unit, target frame; shape_mm, size_mm : RMS distance that a scan so strained keeps from the
    target under its best rigid pose, for the strain without its mean and for the mean alone; left_mm : RMS
    over patches of the distance that no uniform strain explains
    """

    principal: FloatArray
    axes: FloatArray
    shape_mm: float
    size_mm: float
    left_mm: float

    @property
    def mean(self) -> float:
        """Strain that is the same along all axes."""
        return float(self.principal.mean())

    @property
    def spread(self) -> float:
        """How much longer along one direction than along another."""
        return float(self.principal[2] - self.principal[0])


def estimate_strain(
    points: FloatArray,
    weights: FloatArray,
    surface: Surface,
    T_target_source: FloatArray,
    max_distance_mm: float,
) -> Strain | None:
    """points : (k, 3) mm, source frame; weights : (k,) >= 0; surface : in the target frame; T_target_source :
    (4, 4). Correspondences beyond `max_distance_mm` are excluded; None where too few are left.
    """
    placed = rigid.transformed(T_target_source, points)
    centre = np.einsum("k,kd->d", weights, placed) / weights.sum()
    offset = placed - centre
    radius = float(np.sqrt((weights * (offset**2).sum(axis=1)).sum() / weights.sum()))
    T, E, near = np.eye(4), np.zeros(6), None
    for _ in range(ITERATIONS):
        moved = rigid.transformed(T, placed + offset @ _matrix(E))
        closest = surface.closest(moved, near)
        near = closest.face
        w = weights * (closest.distance <= max_distance_mm)
        if (w > 0).sum() < MIN_POINTS:
            return None
        w = w / w.sum()
        J = _columns(moved - centre, closest.normal, radius)
        residual = np.einsum("kd,kd->k", closest.normal, closest.point - moved)
        A = np.einsum("ki,kj->ij", w[:, None] * J, J)
        # residuals are independent between patches, not within one
        ridge = np.einsum("k,k->", w, residual**2) / (PATCHES * (PRIOR * radius) ** 2)
        prior = np.concatenate([np.zeros(6), np.full(6, ridge)])
        gradient = np.einsum("k,ki,k->i", w, J, residual) - prior * np.concatenate([np.zeros(6), E * radius])
        x = np.linalg.solve(A + np.diag(prior + DAMPING * A.diagonal().max()), gradient)
        E = E + x[6:] / radius
        small = rigid.from_vector(np.concatenate([x[:3] / radius, x[3:6]])[None])[0]
        T = rigid.rotation_about(small[:3, :3], centre, small[:3, 3] + centre) @ T
        if np.abs(x).max() < CONVERGENCE * radius:
            break
    if not np.isfinite(E).all():
        return None
    mean = np.where(np.arange(6) < 3, E[:3].mean(), 0.0)
    share, left = patch_means(closest.point, np.where(w > 0, residual, 0.0), weights)
    principal, axes = np.linalg.eigh(_matrix(-E))  # of the source over the target
    return Strain(
        principal=principal,
        axes=axes,
        shape_mm=_kept_mm(J, w, (E - mean) * radius),
        size_mm=_kept_mm(J, w, mean * radius),
        left_mm=float(np.sqrt((share * left**2).sum() / share.sum())),
    )


def _columns(arm: FloatArray, normal: FloatArray, radius: float) -> FloatArray:
    """(k, 12) change of the distance along the normal by a rotation, a translation and a strain; lengths over
    `radius` where they are angles or strains.
    """
    x, y, z = arm.T / radius
    a, b, c = normal.T
    strain = np.stack([a * x, b * y, c * z, a * y + b * x, b * z + c * y, c * x + a * z], axis=1)
    return np.concatenate([np.cross(arm, normal) / radius, normal, strain], axis=1)


def _matrix(E: FloatArray) -> FloatArray:
    """(3, 3) of xx, yy, zz, xy, yz, zx."""
    xx, yy, zz, xy, yz, zx = E
    return np.array([[xx, xy, zx], [xy, yy, yz], [zx, yz, zz]])


def _kept_mm(J: FloatArray, weights: FloatArray, strain_mm: FloatArray) -> float:
    """RMS distance by a strain (6,), times the radius, that no rigid motion takes away."""
    distance = np.einsum("ki,i->k", J[:, 6:], strain_mm)
    rigid_motion = J[:, :6]
    A = np.einsum("k,ki,kj->ij", weights, rigid_motion, rigid_motion)
    b = np.einsum("k,ki,k->i", weights, rigid_motion, distance)
    motion = np.linalg.solve(A + DAMPING * A.diagonal().max() * np.eye(6), b)
    return float(np.sqrt((weights * (distance - np.einsum("ki,i->k", rigid_motion, motion)) ** 2).sum()))
