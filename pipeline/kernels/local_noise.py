"""Noise of a scan from the scan alone: the scatter of its points about local quadratic surfaces.

A quadric through neighbouring points leaves the scatter, and at larger scales also what the shape itself
bends; so several scales are tried and the smallest scatter counts. Distortions that are smooth over many
points are not seen: they bend the quadrics with them.
"""

import numpy as np

from pipeline.core.mesh import FloatArray
from pipeline.kernels.nearest import k_nearest

#: Neighbours of a point that a quadric is fitted to, one number for each scale. Chosen by hand.
NEIGHBOURS = (16, 32, 64)
#: Points at which quadrics are fitted, at most. Chosen by hand.
SAMPLES = 400
#: Distance of two points of opposite normals, over twice the radius of the largest patch. Chosen by hand:
#: enough to leave out the other side of a wall, little beside the scatter of the normals of a noisy scan.
NORMAL_WEIGHT = 0.5
#: Largest RMS radius of a patch over the diagonal of the scan (median). Chosen by hand.
MAX_PATCH_SHARE = 0.03
#: Unknowns of z = a + b x + c y + d x^2 + e x y + f y^2 (derived).
UNKNOWNS = 6


def local_noise_mm(points: FloatArray, seed: int, normals: FloatArray | None = None) -> float | None:
    """Standard deviation (mm) of the points (n, 3) across their own surface; None for too few points.

    normals : (n, 3) unit; with them, the other side of a thin wall is no neighbour

    The median over samples is taken, so that edges and outliers do not count; of the scales the one with the
    smallest median. Scales at which the patches are no longer small beside the part are left out: there its
    shape scatters too.
    """
    if len(points) <= max(NEIGHBOURS):
        return None
    some = np.sort(np.random.default_rng(seed).permutation(len(points))[:SAMPLES])
    index = k_nearest(points, points[some], max(NEIGHBOURS))
    if normals is not None:
        reach_mm = float(np.median(np.linalg.norm(points[index[:, -1]] - points[some], axis=1)))
        oriented = np.concatenate([points, NORMAL_WEIGHT * reach_mm * normals], axis=1)
        index = k_nearest(oriented, oriented[some], max(NEIGHBOURS))
    diagonal_mm = float(np.linalg.norm(np.ptp(points, axis=0)))
    found = []
    for count in NEIGHBOURS:
        size_mm, scatter_mm = _scatter_mm(points[index[:, :count]])
        if np.median(size_mm) <= MAX_PATCH_SHARE * diagonal_mm:
            found.append(float(np.median(scatter_mm)))
    return min(found, default=None)


def _scatter_mm(groups: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(s,) RMS radius of each group of points (s, k, 3), and (s,) standard deviation about its quadric."""
    centred = groups - groups.mean(axis=1, keepdims=True)
    size = np.sqrt((centred**2).sum(axis=2).mean(axis=1))
    centred = centred / np.maximum(size, 1e-300)[:, None, None]
    covariance = np.einsum("ski,skj->sij", centred, centred)
    axes = np.linalg.eigh(covariance)[1]  # the first across the surface
    z, x, y = (np.einsum("ski,si->sk", centred, axes[:, :, column]) for column in range(3))
    terms = np.stack([np.ones_like(x), x, y, x * x, x * y, y * y], axis=2)
    normal = np.einsum("ski,skj->sij", terms, terms) + 1e-9 * np.eye(UNKNOWNS)
    fitted = np.linalg.solve(normal, np.einsum("ski,sk->si", terms, z)[:, :, None])[:, :, 0]
    left = z - np.einsum("ski,si->sk", terms, fitted)
    freedom = groups.shape[1] - UNKNOWNS
    return np.asarray(size), np.asarray(size * np.sqrt((left**2).sum(axis=1) / freedom))
