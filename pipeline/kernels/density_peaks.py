"""Clustering by fast search and find of density peaks (CFSFDP), whatever the distances are.

Rodriguez & Laio, "Clustering by fast search and find of density peaks", Science 344 (2014). Symbols: d_c cut-off
distance, rho local density (eq. 1), delta distance to the nearest denser point (eq. 2). Equal densities rank by
index, so every result is the same on every machine.
"""

from collections.abc import Callable

import numpy as np

from pipeline.mesh import BoolArray, FloatArray, IndexArray, IntArray

_FIRST_BATCH = 32  # vertices of each cluster whose border is looked for at once


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


def halo(rho: FloatArray, labels: IntArray, n_clusters: int, at_border: Callable[[IndexArray], BoolArray]) -> BoolArray:
    """(n,) vertices less dense than their cluster's border density, by the *article's* definition.

    The border region of a cluster are its points within d_c of a point of another cluster; its border density is the highest
    rho in that region. (The authors' published code averages the rho of the two points instead.)

    at_border : for vertices (k,), whether each lies in the border region of its cluster; asked of the densest vertices of each
    cluster first, so it is rarely asked of many
    """
    order = np.lexsort((np.arange(len(rho)), -rho, labels))
    order = order[labels[order] >= 0]
    begin = np.searchsorted(labels[order], np.arange(n_clusters + 1))
    border_rho = np.zeros(n_clusters + 1)  # last: vertices without a cluster
    open_clusters, batch, offset = list(range(n_clusters)), _FIRST_BATCH, 0
    while open_clusters:
        asked = [order[begin[c] + offset : min(begin[c + 1], begin[c] + offset + batch)] for c in open_clusters]
        answers = np.split(at_border(np.concatenate(asked)), np.cumsum([len(each) for each in asked])[:-1])
        still = []
        for cluster, vertices, answer in zip(open_clusters, asked, answers, strict=True):
            if answer.any():
                border_rho[cluster] = rho[vertices[answer.argmax()]]
            elif begin[cluster] + offset + batch < begin[cluster + 1]:
                still.append(cluster)
        open_clusters, offset, batch = still, offset + batch, 2 * batch
    return np.asarray(rho < border_rho[labels], dtype=np.bool_)
