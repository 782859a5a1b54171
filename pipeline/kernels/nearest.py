"""Nearest points through space: scipy's k-d tree with one answer type."""

import numpy as np
from scipy.spatial import cKDTree

from pipeline.core.mesh import FloatArray, IndexArray


def nearest(
    points: FloatArray, queries: FloatArray, *, within_mm: float = np.inf
) -> tuple[FloatArray, IndexArray]:
    """Distance to and number of the nearest of `points` (n, 3), for each of `queries` (..., 3).

    within_mm : where none is nearer, the distance is inf and the number n
    """
    distance, index = cKDTree(points).query(queries, distance_upper_bound=within_mm)
    return np.asarray(distance, dtype=np.float64), np.asarray(index, dtype=np.int64)


def k_nearest(points: FloatArray, queries: FloatArray, k: int) -> IndexArray:
    """(m, k) numbers of the k nearest of `points`, nearest first; k <= n."""
    _, index = cKDTree(points).query(queries, k=list(range(1, k + 1)))
    return np.asarray(index, dtype=np.int64)
