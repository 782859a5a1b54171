"""The clusterings that the paper sets beside CFSFDP (its figure 1), on weighted points.

What is clustered are positions in mm with Euclidean distances: these methods know nothing of the surface,
which is what the comparison is about. Weights are the areas that points stand for, so that a denser
triangulation of one part does not draw centres to it; Gaussian mixture (scikit-learn takes no weights there)
and k-centers go without.

K-means and Gaussian mixture are scikit-learn's. The other three are written out here: scikit-fuzzy (last
release 2024) and pyclustering (archived) are untyped and hardly kept, `kmedoids` is another problem (centres
among the points), and each takes a screen. Every method draws from its seed alone and runs on one thread: the
same bytes every time.

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

STARTS = 10  # fresh seedings of K-means, the best is kept: single ones often put two centres in one blob
SLOW_STARTS = 3  # the same of the others, where a run takes ten times as long
MAX_ITERATIONS = 300
MEMBERSHIP_TOLERANCE = 1e-4  # fuzzy c-means ends when no membership moves by more


@dataclass(frozen=True, slots=True)
class Clusters:
    """labels : (n,) int32 in [0, m), none empty, m <= k; centres : (m,) int64, the member nearest to each
    cluster's centre. The cluster with most points is first; of equal ones that with the lower centre.
    """

    labels: IntArray
    centres: IndexArray


@dataclass(frozen=True, slots=True)
class Partition:
    """What a method finds. labels : (n,) in [0, k); positions_mm : (k, 3) centres, not always of members"""

    labels: IndexArray
    positions_mm: FloatArray


@dataclass(frozen=True, slots=True)
class Fuzzy:
    """memberships : (n, k), rows sum to 1; positions_mm : (k, 3); objective : sum_is w_i u_is^2 |x_i - c_s|^2
    after each update of the centres
    """

    memberships: FloatArray
    positions_mm: FloatArray
    objective: tuple[float, ...]


def cluster(method: str, points: FloatArray, weights: FloatArray, k: int, seed: int) -> Clusters:
    """Cut `points` (n, 3) into at most `k` clusters by a method of `METHODS`; n distinct points give at most
    n.
    """
    k = min(k, len(points))
    floor = np.finfo(np.float64).tiny + 1e-12 * weights.mean()  # a point of no area is still a point
    partition = METHODS[method](points, np.maximum(weights, floor), k, seed)
    return _ordered(points, partition)


def k_means(points: FloatArray, weights: FloatArray, k: int, seed: int) -> Partition:
    """Least sum of w_i |x_i - c|^2: Lloyd from k-means++ seeds (Arthur & Vassilvitskii 2007), by
    scikit-learn.
    """
    from sklearn.cluster import KMeans
    from threadpoolctl import threadpool_limits

    with threadpool_limits(limits=1):  # it adds up in the order its threads finish
        found = KMeans(n_clusters=k, n_init=STARTS, max_iter=MAX_ITERATIONS, random_state=seed)
        found.fit(points, sample_weight=weights)
    return Partition(
        np.asarray(found.labels_, dtype=np.int64), np.asarray(found.cluster_centers_, dtype=np.float64)
    )


def gaussian_mixture(points: FloatArray, weights: FloatArray, k: int, seed: int) -> Partition:
    """k Gaussians with full covariances by expectation maximisation (Dempster et al. 1977), by scikit-learn;
    a point belongs to the component it most likely came from. Without weights.
    """
    from sklearn.exceptions import ConvergenceWarning
    from sklearn.mixture import GaussianMixture
    from threadpoolctl import threadpool_limits

    spread = float(points.var(axis=0).sum())  # scikit-learn's regularisation has a unit: mm^2
    with threadpool_limits(limits=1), warnings.catch_warnings():
        warnings.simplefilter("ignore", ConvergenceWarning)  # the best so far is a result too
        found = GaussianMixture(
            k, n_init=SLOW_STARTS, max_iter=MAX_ITERATIONS, reg_covar=1e-6 * spread, random_state=seed
        ).fit(points)
        labels = found.predict(points)
    return Partition(np.asarray(labels, dtype=np.int64), np.asarray(found.means_, dtype=np.float64))


def k_medians(points: FloatArray, weights: FloatArray, k: int, seed: int) -> Partition:
    """Least sum of w_i |x_i - c|_1: Lloyd's iteration with component-wise medians, best of `SLOW_STARTS`."""
    rng = np.random.default_rng(seed)
    best, least = None, np.inf
    for _ in range(SLOW_STARTS):
        found, cost = _k_medians_from(points, weights, points[_seeds(points, weights, k, rng, order=1)])
        if cost < least:
            best, least = found, cost
    assert best is not None  # noqa: S101 # the cost is finite
    return best


def k_centers(points: FloatArray, weights: FloatArray, k: int, seed: int) -> Partition:
    """Least largest distance to a centre, within a factor of 2: the farthest point is the next centre
    (Gonzalez 1985). The first is the farthest from the mean, so nothing is drawn; without weights.
    """
    positions_mm = points[sampling.farthest(points, k)]
    return Partition(_distances(points, positions_mm, order=2).argmin(axis=1), positions_mm)


def fuzzy_c_means(points: FloatArray, weights: FloatArray, k: int, seed: int) -> Partition:
    """Bezdek 1981 with m = 2, the best of `SLOW_STARTS`; a point belongs where its membership is largest."""
    rng = np.random.default_rng(seed)
    starts = [points[_seeds(points, weights, k, rng, order=2)] for _ in range(SLOW_STARTS)]
    best = min(
        (fuzzy_from(points, weights, start) for start in starts), key=lambda found: found.objective[-1]
    )
    return Partition(best.memberships.argmax(axis=1), best.positions_mm)


def fuzzy_from(points: FloatArray, weights: FloatArray, positions_mm: FloatArray) -> Fuzzy:
    """Fuzzy c-means from given centres (k, 3), to the end."""
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
    """(n, k): u_is = |x_i - c_s|^-2 / sum_t |x_i - c_t|^-2; a point on a centre belongs to it (or them)
    alone.
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
        for empty in np.setdiff1d(np.arange(len(positions_mm)), labels):  # it gets the worst served point
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
    """(3,) component by component the first value at which half the weight is reached."""
    order = np.argsort(points, axis=0, kind="stable")
    reached = np.cumsum(weights[order], axis=0)
    half = (reached >= 0.5 * reached[-1]).argmax(axis=0)
    return np.asarray(points[order[half, range(3)], range(3)], dtype=np.float64)


def _seeds(
    points: FloatArray, weights: FloatArray, k: int, rng: np.random.Generator, *, order: int
) -> IndexArray:
    """(k,) points drawn one after another with probability w_i d_i^order, d_i the distance to the nearest
    drawn one (k-means++; order 1 is its form for medians).
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
    """Empty clusters left out, a member for each centre, the largest cluster first."""
    kept, labels, sizes = np.unique(partition.labels, return_inverse=True, return_counts=True)
    to_centre = np.linalg.norm(points - partition.positions_mm[partition.labels], axis=1)
    by_label = np.lexsort(
        (np.arange(len(points)), to_centre, labels)
    )  # the nearest member first in each cluster
    centres = by_label[np.searchsorted(labels[by_label], np.arange(len(kept)))]
    order = np.lexsort((centres, -sizes))
    rank = np.empty(len(kept), dtype=np.int32)
    rank[order] = np.arange(len(kept), dtype=np.int32)
    return Clusters(rank[labels], centres[order].astype(np.int64))
