"""One step of a weighted, constrained least-squares fit of a rigid part: six unknowns, some of them held.

Rows are measured distances along directions (point to plane: Chen & Medioni 1992), linearised in the six
unknowns of a small motion about a centre; held motions are left out by a basis of the allowed ones
(null-space method). What the rows do not determine, by their rank, stays as it is.
"""

from dataclasses import dataclass

import numpy as np

from pipeline.core.mesh import FloatArray
from pipeline.core.small_motions import DETERMINED_SHARE
from pipeline.kernels import rigid


@dataclass(frozen=True, slots=True, eq=False)
class AllowedMotions:
    """basis : (6, m) twists (rotation vector in radians, translation in mm) about `centre` (3,), mm; None
    allows all. follows : whether the centre is a point of the part, that moves with it, or one of the design
    """

    basis: FloatArray | None
    centre: FloatArray
    follows: bool = True


@dataclass(frozen=True, slots=True, eq=False)
class Step:
    """motion : (4, 4), to be made after the present pose; free : (k, 6) allowed twists about the centre that
    the rows do not determine
    """

    motion: FloatArray
    free: FloatArray


def step(
    points: FloatArray,
    directions: FloatArray,
    residual: FloatArray,
    weights: FloatArray,
    allowed: AllowedMotions,
    determined_share: float = DETERMINED_SHARE,
) -> Step:
    """The small motion that takes `residual` to its least weighted square sum.

    points : (k, 3) mm; directions : (k, 3) unit, along which a point's motion changes its residual; residual
    : (k,) mm; weights : (k,) >= 0; determined_share : a motion that changes the residuals by a smaller share
    of its displacement (RMS) is free
    """
    total = max(float(weights.sum()), 1e-300)
    arm = points - allowed.centre
    radius = max(float(np.sqrt((weights * (arm**2).sum(axis=1)).sum() / total)), 1e-300)
    rows = np.concatenate([np.cross(arm, directions) / radius, directions], axis=1)
    scale = np.concatenate([np.full(3, 1 / radius), np.ones(3)])  # twist = scale * unknowns in mm
    basis = _orthonormal(np.eye(6) if allowed.basis is None else allowed.basis / scale[:, None])
    reduced = np.einsum("ki,ij->kj", rows, basis)  # not by BLAS, which splits sums among threads
    normal = np.einsum("k,ki,kj->ij", weights / total, reduced, reduced)
    right = np.einsum("k,ki,k->i", weights / total, reduced, residual)
    values, vectors = np.linalg.eigh(normal)
    known = values >= determined_share**2
    along = vectors[:, known]
    moved = -basis @ along @ ((along.T @ right) / values[known])
    twist = scale * moved
    turn = rigid.from_vector(twist[None])[0]
    motion = rigid.rotation_about(turn[:3, :3], allowed.centre, allowed.centre + twist[3:])
    return Step(motion, (scale[:, None] * (basis @ vectors[:, ~known])).T)


def _orthonormal(basis: FloatArray) -> FloatArray:
    q, r = np.linalg.qr(basis)
    return np.asarray(q * np.where(np.diag(r) < 0, -1.0, 1.0), dtype=np.float64)
