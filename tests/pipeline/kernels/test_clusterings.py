"""The clusterings of the paper's figure 1, on points whose clusters are known and against what each
method promises.
"""

from itertools import combinations
from typing import get_args

import numpy as np
import pytest
from scipy.spatial.distance import cdist

from pipeline.core.mesh import FloatArray
from pipeline.core.settings import SegmentationMethod
from pipeline.kernels import clusterings

ALL = sorted(clusterings.METHODS)
SIZES = (50, 80, 65)


def blobs(seed: int = 0) -> tuple[FloatArray, FloatArray]:
    """Three clouds of 1 mm, 12 mm apart, with unequal weights."""
    rng = np.random.default_rng(seed)
    middles = [(0, 0, 0), (12, 0, 0), (3, 12, 4)]
    points = [rng.normal(at, 1.0, (size, 3)) for at, size in zip(middles, SIZES, strict=True)]
    return np.concatenate(points), rng.uniform(0.5, 1.5, sum(SIZES))


def test_the_registry_has_every_method_of_the_settings_but_density_peaks() -> None:
    assert {*clusterings.METHODS, "cfsfdp"} == set(get_args(SegmentationMethod))


@pytest.mark.parametrize("method", ALL)
def test_three_blobs_are_three_clusters_the_largest_first(method: str) -> None:
    points, weights = blobs()
    found = clusterings.cluster(method, points, weights, 3, seed=1)
    truth = np.repeat([2, 0, 1], SIZES)  # by size
    np.testing.assert_array_equal(found.labels, truth)
    np.testing.assert_array_equal(found.labels[found.centres], [0, 1, 2])
    if method != "kcenters":  # whose centres lie at the rim
        means = np.array([points[truth == k].mean(axis=0) for k in range(3)])
        assert np.linalg.norm(points[found.centres] - means, axis=1).max() < 1.0


@pytest.mark.parametrize("method", ALL)
def test_the_same_seed_gives_the_same_bytes(method: str) -> None:
    points, weights = np.random.default_rng(4).random((300, 3)), np.ones(300)  # no structure: many near-ties
    once, again = (clusterings.cluster(method, points, weights, 7, seed=5) for _ in range(2))
    assert once.labels.tobytes() == again.labels.tobytes()
    assert once.centres.tobytes() == again.centres.tobytes()


@pytest.mark.parametrize("k", [1, 2, 9, 300])
@pytest.mark.parametrize("method", ["kmeans", "kmedians", "kcenters"])
def test_k_is_honoured(method: str, k: int) -> None:
    points = np.random.default_rng(4).random((300, 3))
    found = clusterings.cluster(method, points, np.ones(300), k, seed=0)
    assert set(found.labels) == set(range(k))
    assert len(set(found.centres)) == k


@pytest.mark.parametrize("method", ["fuzzy_cmeans", "gaussian_mixture"])
def test_soft_methods_leave_no_number_without_points(method: str) -> None:
    points = np.random.default_rng(4).random((300, 3))
    found = clusterings.cluster(method, points, np.ones(300), 9, seed=0)
    assert 1 < len(found.centres) <= 9
    assert set(found.labels) == set(range(len(found.centres)))


@pytest.mark.parametrize("method", ALL)
def test_more_clusters_than_points_are_as_many_as_points(method: str) -> None:
    points = np.random.default_rng(2).random((4, 3))
    assert len(clusterings.cluster(method, points, np.ones(4), 9, seed=0).centres) <= 4


def test_weights_draw_the_centre() -> None:
    """Two points on a line, one three times as heavy: the mean is at 1/4, the median at the heavy one."""
    points, weights = np.array([[0.0, 0, 0], [4.0, 0, 0]]), np.array([3.0, 1.0])
    np.testing.assert_allclose(clusterings.k_means(points, weights, 1, 0).positions_mm, [[1.0, 0, 0]])
    np.testing.assert_allclose(clusterings.k_medians(points, weights, 1, 0).positions_mm, [[0.0, 0, 0]])


def test_fuzzy_memberships_sum_to_one_and_the_objective_never_rises() -> None:
    points, weights = blobs()
    found = clusterings.fuzzy_from(points, weights, points[[0, 1, 2]])  # three seeds in one blob
    np.testing.assert_allclose(found.memberships.sum(axis=1), 1.0, rtol=1e-12)
    assert (found.memberships >= 0).all()
    steps = np.array(found.objective)
    assert len(steps) > 5 and steps[-1] < 0.5 * steps[0]
    assert (np.diff(steps) <= 1e-9 * steps[0]).all()


def test_a_point_on_a_fuzzy_centre_belongs_to_it_alone() -> None:
    points = np.array([[0.0, 0, 0], [1.0, 0, 0], [3.0, 0, 0]])
    found = clusterings._memberships(cdist(points, np.array([[0.0, 0, 0], [4.0, 0, 0]]), "sqeuclidean"))
    np.testing.assert_allclose(found, [[1, 0], [0.9, 0.1], [0.1, 0.9]])


@pytest.mark.parametrize("seed", range(5))
def test_k_centers_radius_is_at_most_twice_the_best_choice_of_points(seed: int) -> None:
    points = np.random.default_rng(seed).random((16, 3))
    found = clusterings.k_centers(points, np.ones(16), 3, 0)
    distance = cdist(points, points)
    best = min(distance[:, list(centres)].min(axis=1).max() for centres in combinations(range(16), 3))
    assert cdist(points, found.positions_mm).min(axis=1).max() <= 2 * best


def test_k_medians_finds_the_best_pair_of_medians_by_brute_force() -> None:
    """On a line every optimal clustering is a cut, so all can be tried."""
    values = np.sort(np.random.default_rng(3).exponential(size=25))
    points = np.stack([values, np.zeros(25), np.zeros(25)], axis=1)
    found = clusterings.k_medians(points, np.ones(25), 2, 0)
    cost = np.abs(values - found.positions_mm[found.labels, 0]).sum()
    cuts = [(values[:cut], values[cut:]) for cut in range(1, 25)]
    assert cost == pytest.approx(
        min(sum(np.abs(half - np.median(half)).sum() for half in cut) for cut in cuts)
    )
