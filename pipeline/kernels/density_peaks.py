"""Clustering by fast search and find of density peaks (CFSFDP), on any sparse set of near pairs.

Rodriguez & Laio, "Clustering by fast search and find of density peaks", Science 344 (2014). Symbols: d_c cut-off
distance, rho local density (eq. 1), delta distance to the nearest denser point (eq. 2). Equal densities rank by
index, so every result is the same on every machine.
"""

import numpy as np
from scipy.sparse import csr_matrix

from pipeline.mesh import BoolArray, FloatArray, IndexArray, IntArray


def local_density(near: csr_matrix, d_c: float, weights: FloatArray) -> FloatArray:
    """Eq. 1 with a weight for each j: rho_i = sum_j w_j chi(d_ij - d_c), chi(x) = 1 for x < 0.

    near : (n, n) stored pairs i != j with at least all d_ij < d_c; weights : (n,), ones count vertices,
    lumped areas measure the surface inside d_c (the own vertex's included).
    """
    inside = near.copy()
    inside.data = (near.data < d_c).astype(np.float64)
    return np.asarray(inside @ weights, dtype=np.float64) + weights


def choose_centres(
    rho: FloatArray,
    delta: FloatArray,
    forced: IndexArray,
    *,
    delta_min: float,
    rho_min: float,
    max_centres: int,
    n_centres: int | None,
) -> IndexArray:
    """Vertices at the upper right of the decision graph, largest rho * delta first.

    forced : always centres (the densest vertex of each piece). Beside them, `n_centres` in all by rho * delta if
    given, else every vertex with delta >= `delta_min` and rho >= `rho_min`, at most `max_centres`.
    """
    gamma = rho * np.where(np.isfinite(delta), delta, 0.0)
    order = np.argsort(-gamma, kind="stable")
    is_forced = np.isin(order, forced)
    if n_centres is None:
        others = order[~is_forced & (delta[order] >= delta_min) & (rho[order] >= rho_min)]
        room = max(0, max_centres - len(forced))
    else:
        others, room = order[~is_forced], max(0, n_centres - len(forced))
    chosen = np.concatenate([order[is_forced], others[:room]])
    return chosen[np.argsort(-gamma[chosen], kind="stable")].astype(np.int64)


def assign(nearest_denser: IndexArray, centres: IndexArray) -> IntArray:
    """(n,) int32 cluster of each vertex: that of its nearest denser vertex; -1 where no centre is uphill."""
    n = len(nearest_denser)
    uphill = np.append(np.where(nearest_denser >= 0, nearest_denser, n), n)  # vertex n: no centre
    uphill[centres] = centres
    while True:  # pointer doubling: after k rounds every vertex points 2^k steps uphill
        further = uphill[uphill]
        if (further == uphill).all():
            break
        uphill = further
    label = np.full(n + 1, -1, dtype=np.int32)
    label[centres] = np.arange(len(centres), dtype=np.int32)
    return np.asarray(label[uphill[:n]], dtype=np.int32)


def halo(near: csr_matrix, d_c: float, rho: FloatArray, labels: IntArray) -> BoolArray:
    """(n,) vertices less dense than their cluster's border density, by the *article's* definition.

    The border region of a cluster are its points within d_c of a point of another cluster; its border density is
    the highest rho in that region. (The authors' published code averages the rho of the two points instead.)
    """
    pairs = near.tocoo()
    across = (pairs.data < d_c) & (labels[pairs.row] != labels[pairs.col])
    across &= (labels[pairs.row] >= 0) & (labels[pairs.col] >= 0)
    border_rho = np.zeros(int(labels.max(initial=-1)) + 2)  # last: vertices without a cluster
    np.maximum.at(border_rho, labels[pairs.row[across]], rho[pairs.row[across]])
    return np.asarray(rho < border_rho[labels], dtype=np.bool_)
