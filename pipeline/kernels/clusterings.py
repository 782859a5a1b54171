"""The clustering methods that the paper compares with CFSFDP (its figure 1), on weighted points.

The input is positions in mm with Euclidean distances: unlike CFSFDP, these methods do not use the surface.
The weights are the vertex areas, so a denser triangulation of one region does not attract centres. Gaussian
mixture (scikit-learn accepts no weights there) and k-centers ignore the weights.

K-means and Gaussian mixture come from scikit-learn. The other three are implemented here, each in a few
lines: scikit-fuzzy and pyclustering (archived) have no types and little maintenance, and `kmedoids` solves a
different problem (its centres are input points). Every method uses only its seed as a source of randomness
and runs on one thread, so the result is reproducible to the byte.

    n points, k clusters, w_i weight of point i, c_s centre of cluster s, u_is membership of point i in
    cluster s
"""

import warnings
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.spatial.distance import cdist

from pipeline.core.mesh import FloatArray, IndexArray, IntArray
from pipeline.kernels import sampling

#: Initialisations of K-means; the best result is kept, because a single one often puts two centres in one
#: cluster. Chosen by hand, not fitted.
STARTS = 10
#: Initialisations of the other methods, where one run takes about ten times as long. Chosen by hand, not
#: fitted.
SLOW_STARTS = 3
#: Iterations of one run, at most; scikit-learn's default for K-means.
MAX_ITERATIONS = 300
#: Fuzzy c-means stops when no membership changes by more (no unit). Chosen by hand, not fitted.
MEMBERSHIP_TOLERANCE = 1e-4
#: Smallest weight of a point, as a share of the mean weight: a point without area remains a point. Chosen by
#: hand, not fitted.
_MIN_WEIGHT_SHARE = 1e-12
#: Regularisation of the covariances, as a share of the total variance (scikit-learn's is an absolute number,
#: 1e-6, here in mm^2). Chosen by hand, not fitted.
_COVARIANCE_SHARE = 1e-6


@dataclass(frozen=True, slots=True)
class Clusters:
    """Result of `cluster`: m <= k clusters, none empty, the one with the most points first.

    labels : (n,) int32 in [0, m); centres : (m,) int64, index of the member nearest to each cluster's centre.
    Clusters of equal size are ordered by the index of the centre.
    """

    labels: IntArray
    centres: IndexArray


@dataclass(frozen=True, slots=True)
class Partition:
    """Result of one method. labels : (n,) in [0, k); positions_mm : (k, 3) mm, centres"""

    labels: IndexArray
    positions_mm: FloatArray


@dataclass(frozen=True, slots=True)
class Fuzzy:
    """Result of fuzzy c-means.

    memberships : (n, k), rows sum to 1; positions_mm : (k, 3) centres; objective : mm^2 times the unit of the
    weights, sum_is w_i u_is^2 |x_i - c_s|^2 after each update of the centres
    """

    memberships: FloatArray
    positions_mm: FloatArray
    objective: tuple[float, ...]


def cluster(method: str, points: FloatArray, weights: FloatArray, k: int, seed: int) -> Clusters:
    """Cluster `points` (n, 3) mm with `weights` (n,) into at most min(k, n) clusters.

    method : a key of `METHODS`
    """
    k = min(k, len(points))
    floor = np.finfo(np.float64).tiny + _MIN_WEIGHT_SHARE * weights.mean()
    partition = METHODS[method](points, np.maximum(weights, floor), k, seed)
    return _ordered(points, partition)


def k_means(points: FloatArray, weights: FloatArray, k: int, seed: int) -> Partition:
    """Minimise sum_i w_i |x_i - c|^2: Lloyd's iteration from k-means++ seeds (Arthur & Vassilvitskii 2007),
    by scikit-learn.
    """
    from sklearn.cluster import KMeans
    from threadpoolctl import threadpool_limits

    with threadpool_limits(limits=1):  # the order of summation depends on the threads
        model = KMeans(n_clusters=k, n_init=STARTS, max_iter=MAX_ITERATIONS, random_state=seed)
        model.fit(points, sample_weight=weights)
    return Partition(
        np.asarray(model.labels_, dtype=np.int64), np.asarray(model.cluster_centers_, dtype=np.float64)
    )


def gaussian_mixture(points: FloatArray, weights: FloatArray, k: int, seed: int) -> Partition:
    """k Gaussians with full covariances by expectation maximisation (Dempster et al. 1977), by scikit-learn.

    Each point is assigned to its most probable component. The weights are not used.
    """
    from sklearn.exceptions import ConvergenceWarning
    from sklearn.mixture import GaussianMixture
    from threadpoolctl import threadpool_limits

    spread = float(points.var(axis=0).sum())  # mm^2, the unit of scikit-learn's reg_covar
    with threadpool_limits(limits=1), warnings.catch_warnings():
        warnings.simplefilter("ignore", ConvergenceWarning)  # an iteration limit is no error here
        model = GaussianMixture(
            k,
            n_init=SLOW_STARTS,
            max_iter=MAX_ITERATIONS,
            reg_covar=_COVARIANCE_SHARE * spread,
            random_state=seed,
        ).fit(points)
        labels = model.predict(points)
    return Partition(np.asarray(labels, dtype=np.int64), np.asarray(model.means_, dtype=np.float64))


def k_medians(points: FloatArray, weights: FloatArray, k: int, seed: int) -> Partition:
    """Minimise sum_i w_i |x_i - c|_1: Lloyd's iteration with component-wise medians; best of several."""
    rng = np.random.default_rng(seed)
    best, min_cost = None, np.inf
    for _ in range(SLOW_STARTS):
        partition, cost = _k_medians_from(points, weights, points[_seeds(points, weights, k, rng, order=1)])
        if cost < min_cost:
            best, min_cost = partition, cost
    assert best is not None  # noqa: S101 # the cost is finite
    return best


def k_centers(points: FloatArray, weights: FloatArray, k: int, seed: int) -> Partition:
    """Minimise the largest distance to a centre, within a factor of 2 (Gonzalez 1985).

    The next centre is the point farthest from all centres so far; the first is the point farthest from the
    mean. Deterministic; neither the weights nor the seed are used.
    """
    positions_mm = points[sampling.farthest(points, k)]
    return Partition(_distances(points, positions_mm, order=2).argmin(axis=1), positions_mm)


def fuzzy_c_means(points: FloatArray, weights: FloatArray, k: int, seed: int) -> Partition:
    """Bezdek 1981 with fuzzifier m = 2, best of `SLOW_STARTS`. Each point is assigned by its largest
    membership.
    """
    rng = np.random.default_rng(seed)
    starts = [points[_seeds(points, weights, k, rng, order=2)] for _ in range(SLOW_STARTS)]
    best = min(
        (fuzzy_from(points, weights, start) for start in starts), key=lambda result: result.objective[-1]
    )
    return Partition(best.memberships.argmax(axis=1), best.positions_mm)


def fuzzy_from(points: FloatArray, weights: FloatArray, positions_mm: FloatArray) -> Fuzzy:
    """Fuzzy c-means from the start centres `positions_mm` (k, 3), until convergence."""
    objective: list[float] = []
    memberships = _memberships(_distances_sq(points, positions_mm))
    for _ in range(MAX_ITERATIONS):
        pull = weights[:, None] * memberships**2
        positions_mm = (pull.T @ points) / pull.sum(axis=0)[:, None]
        dist_sq = _distances_sq(points, positions_mm)
        objective.append(float((pull * dist_sq).sum()))
        before, memberships = memberships, _memberships(dist_sq)
        if np.abs(memberships - before).max() <= MEMBERSHIP_TOLERANCE:
            break
    return Fuzzy(memberships, positions_mm, tuple(objective))


Method = Callable[[FloatArray, FloatArray, int, int], Partition]
METHODS: dict[str, Method] = {
    "kmeans": k_means,
    "fuzzy_cmeans": fuzzy_c_means,
    "kmedians": k_medians,
    "kcenters": k_centers,
    "gaussian_mixture": gaussian_mixture,
}


def _memberships(dist_sq: FloatArray) -> FloatArray:
    """(n, k): u_is = |x_i - c_s|^-2 / sum_t |x_i - c_t|^-2 (Bezdek 1981).

    A point that coincides with one or more centres belongs to these only.
    """
    nearest = dist_sq.min(axis=1, keepdims=True)
    with np.errstate(invalid="ignore"):  # 0 / 0 on a centre
        share = np.where(nearest > 0, nearest / dist_sq, dist_sq == 0)
    memberships: FloatArray = share / share.sum(axis=1, keepdims=True)
    return memberships


def _k_medians_from(
    points: FloatArray, weights: FloatArray, positions_mm: FloatArray
) -> tuple[Partition, float]:
    positions_mm = positions_mm.copy()
    labels = np.full(len(points), -1, dtype=np.int64)
    for _ in range(MAX_ITERATIONS):
        distance = _distances(points, positions_mm, order=1)
        before, labels = labels, distance.argmin(axis=1)
        own = np.take_along_axis(distance, labels[:, None], axis=1)[:, 0]
        for empty in np.setdiff1d(
            np.arange(len(positions_mm)), labels
        ):  # it gets the point with the largest distance
            worst = int(own.argmax())
            labels[worst], own[worst] = empty, 0.0
        if (labels == before).all():
            break
        for number in range(len(positions_mm)):
            members = labels == number
            positions_mm[number] = _weighted_median(points[members], weights[members])
    cost = float(weights @ np.abs(points - positions_mm[labels]).sum(axis=1))
    return Partition(labels, positions_mm), cost


def _weighted_median(points: FloatArray, weights: FloatArray) -> FloatArray:
    """(3,) for each component the smallest value at which the cumulated weight reaches one half."""
    order = np.argsort(points, axis=0, kind="stable")
    reached = np.cumsum(weights[order], axis=0)
    half = (reached >= 0.5 * reached[-1]).argmax(axis=0)
    return np.asarray(points[order[half, range(3)], range(3)], dtype=np.float64)


def _seeds(
    points: FloatArray, weights: FloatArray, k: int, rng: np.random.Generator, *, order: int
) -> IndexArray:
    """(k,) indices of the start centres, by k-means++ (order 2) or its variant for medians (order 1).

    They are drawn one after another with probability proportional to w_i d_i^order, where d_i is the distance
    from point i to the nearest centre drawn so far.
    """
    chance = weights.copy()
    nearest = np.full(len(points), np.inf)
    drawn = np.zeros(k, dtype=np.int64)
    for number in range(k):
        drawn[number] = rng.choice(len(points), p=chance / chance.sum())
        nearest = np.minimum(nearest, _distances(points, points[drawn[number], None], order=order)[:, 0])
        chance = weights * nearest**order if nearest.any() else weights  # fewer distinct points than k
    return drawn


def _distances(points: FloatArray, positions_mm: FloatArray, *, order: int) -> FloatArray:
    """(n, k) mm: city-block (order 1) or Euclidean (order 2)."""
    metric: Literal["cityblock", "euclidean"] = "cityblock" if order == 1 else "euclidean"
    return np.asarray(cdist(points, positions_mm, metric), dtype=np.float64)


def _distances_sq(points: FloatArray, positions_mm: FloatArray) -> FloatArray:
    """(n, k) mm^2, Euclidean."""
    return np.asarray(cdist(points, positions_mm, "sqeuclidean"), dtype=np.float64)


def _ordered(points: FloatArray, partition: Partition) -> Clusters:
    """Drop empty clusters, replace each centre by its nearest member, and sort the largest cluster first."""
    used, labels, sizes = np.unique(partition.labels, return_inverse=True, return_counts=True)
    to_centre = np.linalg.norm(points - partition.positions_mm[partition.labels], axis=1)
    # By cluster, then the member nearest to the centre first.
    by_label = np.lexsort((np.arange(len(points)), to_centre, labels))
    centres = by_label[np.searchsorted(labels[by_label], np.arange(len(used)))]
    order = np.lexsort((centres, -sizes))
    rank = np.empty(len(used), dtype=np.int32)
    rank[order] = np.arange(len(used), dtype=np.int32)
    return Clusters(rank[labels], centres[order].astype(np.int64))
