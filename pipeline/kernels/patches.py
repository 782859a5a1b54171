"""Averages over patches of a surface: what varies slowly remains, noise averages out."""

import numpy as np

from pipeline.core.mesh import FloatArray, IndexArray

#: Patches that a surface is divided into. Chosen by hand; not fitted.
PATCHES = 100


def patch_means(points: FloatArray, values: FloatArray, weights: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Weight (p,) and weighted mean value (p,) of each patch; about `PATCHES` patches on a compact part.

    points : (k, 3) mm on the surface; values : (k,); weights : (k,) >= 0; patches as in `some_patches`
    """
    patch = some_patches(points)
    share = np.bincount(patch, weights=weights).astype(np.float64)
    mean = np.bincount(patch, weights=weights * values) / np.maximum(share, 1e-300)
    return share, mean


def some_patches(points: FloatArray, count: int = PATCHES) -> IndexArray:
    """(k,) number of the patch of each of `points` (k, 3) mm, of about `count` on a compact part.

    The patch edge in mm follows from the two longest sides a, b of the axis-aligned box of the points:
    edge^2 = 2 a b / count, as if the box had an upper and a lower side.
    """
    extent = np.ptp(points, axis=0)
    return patches(points, float(np.sqrt(max(np.sort(extent)[-2:].prod(), 1e-300) * 2.0 / count)))


def patches(points: FloatArray, edge_mm: float) -> IndexArray:
    """(k,) number of the cube with edge `edge_mm` that contains each point; empty cubes have no number.

    points : (k, 3) mm. The edge is at least 1e-5 of the longest side of the box, which limits the number of
    cubes for points on one line, where `edge_mm` may be zero.
    """
    edge_mm = max(edge_mm, 1e-5 * float(np.ptp(points, axis=0).max()), 1e-300)
    cell = np.floor((points - points.min(axis=0)) / edge_mm).astype(np.int64)
    # One integer a cube sorts much faster than a row of three.
    of_cell = np.ravel_multi_index(tuple(cell.T), tuple(cell.max(axis=0) + 1))
    return np.asarray(np.unique(of_cell, return_inverse=True)[1], dtype=np.int64)
