"""Clustering by fast search and find of density peaks (CFSFDP), for any metric.

Rodriguez & Laio, "Clustering by fast search and find of density peaks", Science 344 (2014). Symbols: d_c
cut-off distance, rho local density (eq. 1), delta distance to the nearest denser point (eq. 2). Equal
densities are ordered by index, so the results are the same on every machine.
"""

from collections.abc import Callable

import numpy as np

from pipeline.core.mesh import BoolArray, FloatArray, IndexArray, IntArray

#: Vertices of each cluster in the first batch of `halo`; later batches double. Affects only the time.
_FIRST_BATCH = 32
#: Lower limit of a density before its logarithm; avoids log 0.
_MIN_DENSITY = 1e-300


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
    """(c,) indices of the cluster centres, by decreasing gamma = rho * delta.

    rho, delta : (n,); forced : (f,) vertices that are always centres (the densest vertex of each piece).
    The other centres: if `n_centres` is set, those with the largest gamma, `n_centres` in all with `forced`;
    otherwise every vertex with delta >= `delta_min` and rho >= `rho_min`, at most `max_centres` in all.
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
    """(n,) int32: cluster of each vertex, which is the cluster of its nearest denser vertex.

    nearest_denser : (n,) index, -1 for none; centres : (c,). The cluster is -1 if the chain of denser
    vertices reaches no centre.
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
    """Merge density peaks across dense borders; the remaining peaks are the centres.

    Average linkage over the borders, similar to topological persistence (Edelsbrunner, Letscher, Zomorodian
    2002). The mean over a border, instead of its densest point, separates two touching teeth but keeps the
    two cusps of one tooth together.

    Every candidate (vertex with delta above d_c) starts as one cluster. In each step the touching pair of
    clusters with the smallest prominence p = log min(rho_peak) - mean over border edges of log min(rho_i,
    rho_j) is merged: the cluster of the lower peak joins that of the higher one, and their borders are
    pooled. The merging stops when no p is below `min_prominence`, or when `n_centres` clusters remain. For
    equal p the pair with the smaller indices is merged.

    rho : (n,) > 0; labels : (n,) cluster of each vertex, -1 none; candidates : (k,), peak of
    cluster c; ends : (e, 2) mesh edges; min_prominence : no unit.

    Returns
    -------
    centres : (c,) subset of `candidates`, in their order; labels : (n,) int32 position in `centres`, -1 for
    none
    """
    k = len(candidates)
    height = np.log(np.maximum(rho, _MIN_DENSITY))
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
    n_clusters = k
    while n_clusters > (n_centres or 1):
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
        n_clusters -= 1
    remaining_roots, number = np.unique(root, return_inverse=True)
    new = np.append(number, -1).astype(np.int32)  # last: no cluster
    return candidates[remaining_roots].astype(np.int64), new[labels]


def halo(
    rho: FloatArray, labels: IntArray, n_clusters: int, at_border: Callable[[IndexArray], BoolArray]
) -> BoolArray:
    """(n,) whether a vertex is less dense than the border density of its cluster (Rodriguez & Laio 2014).

    This is the definition of the *article*: the border region of a cluster contains its points within d_c of
    a point of another cluster, and the border density is the highest rho in this region. (The authors'
    published code averages the rho of the two points instead.)

    rho : (n,); labels : (n,) cluster, -1 none; at_border : for vertices (k,), whether each lies in the border
    region of its cluster. It is called for the densest vertices of each cluster first, so usually for few.
    """
    order = np.lexsort((np.arange(len(rho)), -rho, labels))
    order = order[labels[order] >= 0]
    begin = np.searchsorted(labels[order], np.arange(n_clusters + 1))
    border_rho = np.zeros(n_clusters + 1)  # last: vertices without a cluster
    open_clusters, batch, offset = list(range(n_clusters)), _FIRST_BATCH, 0
    while open_clusters:
        tested = [
            order[begin[c] + offset : min(begin[c + 1], begin[c] + offset + batch)] for c in open_clusters
        ]
        sizes = [len(vertices) for vertices in tested]
        on_border = np.split(at_border(np.concatenate(tested)), np.cumsum(sizes)[:-1])
        remaining = []
        for cluster, vertices, is_border in zip(open_clusters, tested, on_border, strict=True):
            if is_border.any():
                border_rho[cluster] = rho[vertices[is_border.argmax()]]
            elif begin[cluster] + offset + batch < begin[cluster + 1]:
                remaining.append(cluster)
        open_clusters, offset, batch = remaining, offset + batch, 2 * batch
    return np.asarray(rho < border_rho[labels], dtype=np.bool_)
