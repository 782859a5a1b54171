"""Clustering by fast search and find of density peaks (CFSFDP), whatever the distances are.

Rodriguez & Laio, "Clustering by fast search and find of density peaks", Science 344 (2014). Symbols: d_c
cut-off distance, rho local density (eq. 1), delta distance to the nearest denser point (eq. 2). Equal
densities rank by index, so every result is the same on every machine.
"""

from collections.abc import Callable

import numpy as np

from pipeline.core.mesh import BoolArray, FloatArray, IndexArray, IntArray

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

    forced : always centres (the densest vertex of each piece). Beside them, `n_centres` in all by rho * delta
    if given, else every vertex with delta >= `delta_min` and rho >= `rho_min`, at most `max_centres`.
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
    """(n,) int32 cluster of each vertex: that of its nearest denser vertex; -1 if that chain reaches no
    centre.
    """
    n = len(nearest_denser)
    ancestor = np.append(np.where(nearest_denser >= 0, nearest_denser, n), n)  # vertex n: no centre
    ancestor[centres] = centres
    while True:  # pointer doubling: after k rounds each entry is 2^k steps towards denser vertices
        doubled = ancestor[ancestor]
        if (doubled == ancestor).all():
            break
        ancestor = doubled
    label = np.full(n + 1, -1, dtype=np.int32)
    label[centres] = np.arange(len(centres), dtype=np.int32)
    return np.asarray(label[ancestor[:n]], dtype=np.int32)


def persistent_centres(
    rho: FloatArray,
    labels: IntArray,
    candidates: IndexArray,
    ends: IndexArray,
    *,
    min_prominence: float,
    n_centres: int | None = None,
) -> tuple[IndexArray, IntArray]:
    """Join density peaks over dense borders; what stays are the centres.

    Average linkage over the borders, in the spirit of topological persistence (Edelsbrunner, Letscher,
    Zomorodian 2002): the mean of a border, not its one densest point, tells two touching teeth from two cusps
    of one.

    Every candidate (vertex with delta above d_c) starts a cluster. Of all touching pairs of clusters the one
    with the least prominence p = log min(rho_peak) - mean over border edges of log min(rho_i, rho_j) is
    joined, the lower peak's cluster into the higher's, borders and their means being pooled, until no p is
    below `min_prominence` or `n_centres` are left. Equal p: the pair with the smaller indices.

    rho : (n,) > 0; labels : (n,) cluster of each vertex, -1 none; candidates : (k,), cluster c's peak; ends :
    (e, 2) mesh edges.

    Returns
    -------
    centres : (c,) subset of `candidates`, in their order; labels : (n,) int32 numbers in `centres`, -1 kept
    """
    k = len(candidates)
    height = np.log(np.maximum(rho, 1e-300))
    a, b = labels[ends[:, 0]], labels[ends[:, 1]]
    across = (a != b) & (a >= 0) & (b >= 0)
    a, b = a[across], b[across]
    border = np.minimum(height[ends[across, 0]], height[ends[across, 1]])
    total, count = np.zeros((k, k)), np.zeros((k, k))
    for i, j in ((a, b), (b, a)):
        np.add.at(total, (i, j), border)
        np.add.at(count, (i, j), 1.0)
    peak = height[candidates].copy()

    def prominences(c: int | slice) -> FloatArray:
        touching = count[c] > 0
        mean = np.divide(total[c], count[c], out=np.full_like(total[c], -np.inf), where=touching)
        lower = np.minimum(peak[c, None] if isinstance(c, slice) else peak[c], peak)
        return np.asarray(np.where(touching, lower - mean, np.inf), dtype=np.float64)

    root = np.arange(k)
    prominence = prominences(slice(None))
    left = k
    while left > (n_centres or 1):
        i, j = divmod(int(prominence.argmin()), k)
        p = prominence[i, j]
        if not np.isfinite(p) or (n_centres is None and p >= min_prominence):
            break
        keep, drop = (i, j) if (peak[i], -i) > (peak[j], -j) else (j, i)
        root[root == drop] = keep
        for table in (total, count):
            table[keep] += table[drop]
            table[:, keep] = table[keep]
            table[drop], table[:, drop] = 0.0, 0.0
            table[keep, keep] = 0.0
        prominence[drop], prominence[:, drop] = np.inf, np.inf
        prominence[keep] = prominences(keep)
        prominence[:, keep] = prominence[keep]
        left -= 1
    kept, number = np.unique(root, return_inverse=True)
    new = np.append(number, -1).astype(np.int32)  # last: no cluster
    return candidates[kept].astype(np.int64), new[labels]


def halo(
    rho: FloatArray, labels: IntArray, n_clusters: int, at_border: Callable[[IndexArray], BoolArray]
) -> BoolArray:
    """(n,) vertices less dense than their cluster's border density, by the *article's* definition.

    The border region of a cluster are its points within d_c of a point of another cluster; its border density
    is the highest rho in that region. (The authors' published code averages the rho of the two points
    instead.)

    at_border : for vertices (k,), whether each lies in the border region of its cluster; asked of the densest
    vertices of each cluster first, so it is rarely asked of many
    """
    order = np.lexsort((np.arange(len(rho)), -rho, labels))
    order = order[labels[order] >= 0]
    begin = np.searchsorted(labels[order], np.arange(n_clusters + 1))
    border_rho = np.zeros(n_clusters + 1)  # last: vertices without a cluster
    open_clusters, batch, offset = list(range(n_clusters)), _FIRST_BATCH, 0
    while open_clusters:
        asked = [
            order[begin[c] + offset : min(begin[c + 1], begin[c] + offset + batch)] for c in open_clusters
        ]
        answers = np.split(at_border(np.concatenate(asked)), np.cumsum([len(each) for each in asked])[:-1])
        still = []
        for cluster, vertices, answer in zip(open_clusters, asked, answers, strict=True):
            if answer.any():
                border_rho[cluster] = rho[vertices[answer.argmax()]]
            elif begin[cluster] + offset + batch < begin[cluster + 1]:
                still.append(cluster)
        open_clusters, offset, batch = still, offset + batch, 2 * batch
    return np.asarray(rho < border_rho[labels], dtype=np.bool_)
