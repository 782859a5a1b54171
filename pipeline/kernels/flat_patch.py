"""The largest nearly flat part of a set of points: a table in a scan, bent by the scanner's distortion."""

from dataclasses import dataclass

import numpy as np

from pipeline.core.mesh import BoolArray, FloatArray

#: Planes through three random points that are tried, and points that judge each. Chosen by hand: one of a
#: plane with a fifth of the points is among them with a probability above 99 %.
TRIALS, JUDGES = 600, 2_000
#: Degree of the surface over the plane: what cameras bend a plane to. Chosen by hand.
DEGREE = 3
#: Fits, each to what lies near the one before. Chosen by hand.
ROUNDS = 4
#: Standard deviations in a median absolute deviation (of the normal distribution), and how many of them from
#: the surface a point of it lies at most.
SIGMA_PER_MAD, SIGMAS = 1.4826, 4.0


@dataclass(frozen=True, slots=True)
class FlatPatch:
    """is_on : (n,) the points on it; width_mm : diameter of the disc, about their mean, that holds 98 %"""

    is_on: BoolArray
    width_mm: float


def largest_flat_patch(
    points: FloatArray, coarse_mm: float, finest_mm: float, seed: int, min_share: float
) -> FlatPatch | None:
    """points : (n, 3) mm; coarse_mm : distance from a plane within which a bent table lies; finest_mm : from
    the bent surface, at least; min_share : of the points, that lie near the plane; None where fewer do.
    """
    if len(points) == 0:
        return None
    rng = np.random.default_rng(seed)
    judges = points[rng.integers(len(points), size=JUDGES)]
    corners = points[rng.integers(len(points), size=(TRIALS, 3))]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    lengths = np.linalg.norm(normals, axis=1)
    normals = normals / np.maximum(lengths, 1e-300)[:, None]
    heights = np.einsum("jd,td->tj", judges, normals)
    heights -= np.einsum("td,td->t", corners[:, 0], normals)[:, None]
    near = (np.abs(heights) <= coarse_mm).sum(axis=1) * (lengths > 0)
    best = int(near.argmax())
    if near[best] < min_share * JUDGES:
        return None
    is_on = np.abs(np.einsum("nd,d->n", points - corners[best, 0], normals[best])) <= coarse_mm
    for _ in range(ROUNDS):
        centre = points[is_on].mean(axis=0)
        axes = np.linalg.svd(points[is_on] - centre, full_matrices=False)[2]
        across, height = (points - centre) @ axes[:2].T, (points - centre) @ axes[2]
        terms = _terms(across / max(float(np.abs(across[is_on]).max()), 1e-300))
        fitted = np.linalg.lstsq(terms[is_on], height[is_on], rcond=None)[0]
        left = np.abs(height - np.einsum("nt,t->n", terms, fitted))
        sigma_mm = SIGMA_PER_MAD * float(np.median(left[is_on]))
        is_on = left <= min(coarse_mm, max(SIGMAS * sigma_mm, finest_mm))
        if is_on.sum() < min_share * len(points):
            return None
    radius_mm = np.linalg.norm(across[is_on] - across[is_on].mean(axis=0), axis=1)
    return FlatPatch(is_on, 2 * float(np.quantile(radius_mm, 0.98)))


def _terms(across: FloatArray) -> FloatArray:
    """(n, t) monomials of two coordinates (n, 2), up to `DEGREE`."""
    x, y = across.T
    powers = [(i, j) for i in range(DEGREE + 1) for j in range(DEGREE + 1 - i)]
    return np.stack([x**i * y**j for i, j in powers], axis=1)
