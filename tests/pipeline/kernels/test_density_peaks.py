"""Density peaks on point sets whose answer is known, checked against the formulas written out."""

from collections.abc import Callable

import numpy as np
from scipy.spatial.distance import cdist

from pipeline.core.mesh import BoolArray, FloatArray, IndexArray, IntArray
from pipeline.kernels import density_peaks
from pipeline.kernels.geodesics import density_rank


def clouds(*centres: tuple[float, float], count: int = 60, seed: int = 0) -> FloatArray:
    rng = np.random.default_rng(seed)
    return np.concatenate([rng.normal(centre, 0.5, (count, 2)) for centre in centres])


def uphill(matrix: FloatArray, rho: FloatArray) -> tuple[IndexArray, FloatArray]:
    rank = density_rank(rho)
    denser = np.where(rank[None, :] < rank[:, None], matrix, np.inf)
    nearest = denser.argmin(axis=1)
    delta = denser.min(axis=1)
    return np.where(np.isfinite(delta), nearest, -1), np.where(np.isfinite(delta), delta, matrix.max())


def counted(matrix: FloatArray, d_c: float) -> FloatArray:
    """Eq. 1 written out, the point itself included."""
    return np.asarray((matrix < d_c).sum(axis=1), dtype=np.float64)


def test_three_clouds_give_three_segments() -> None:
    points = clouds((0, 0), (6, 0), (0, 7))
    matrix = cdist(points, points)
    rho = counted(matrix, 1.0)
    nearest, delta = uphill(matrix, rho)
    top = np.flatnonzero(nearest < 0)
    centres = density_peaks.choose_centres(
        rho, delta, top, delta_min=2.0, rho_min=float(np.median(rho)) / 2, max_centres=10, n_centres=None
    )
    labels = density_peaks.assign(nearest, centres)
    assert len(centres) == 3
    truth = np.repeat([0, 1, 2], 60)
    assert all(len(set(labels[truth == k])) == 1 for k in range(3))
    assert len(set(labels)) == 3


def test_asking_for_two_centres_gives_two() -> None:
    points = clouds((0, 0), (6, 0), (0, 7))
    matrix = cdist(points, points)
    rho = counted(matrix, 1.0)
    nearest, delta = uphill(matrix, rho)
    centres = density_peaks.choose_centres(
        rho, delta, np.flatnonzero(nearest < 0), delta_min=0, rho_min=0, max_centres=10, n_centres=2
    )
    assert len(centres) == 2
    assert set(density_peaks.assign(nearest, centres)) == {0, 1}


def test_equal_densities_rank_by_index() -> None:
    np.testing.assert_array_equal(density_rank(np.array([1.0, 2.0, 2.0, 1.0])), [2, 0, 1, 3])


def test_a_point_without_a_centre_uphill_has_no_cluster() -> None:
    labels = density_peaks.assign(np.array([-1, 0, 1, -1, 3]), np.array([0]))
    np.testing.assert_array_equal(labels, [0, 0, 0, -1, -1])


def test_halo_is_what_is_less_dense_than_the_border_of_its_cluster() -> None:
    """Two clusters on a line, touching in the middle: 0 1 2 | 3 4 5, d_c just above 1."""
    matrix = np.abs(np.subtract.outer(np.arange(6.0), np.arange(6.0)))
    rho = np.array([1.0, 5.0, 2.0, 3.0, 6.0, 4.0])
    labels = np.array([0, 0, 0, 1, 1, 1], dtype=np.int32)
    found = density_peaks.halo(rho, labels, 2, at_border_by(matrix, labels, 1.5))
    np.testing.assert_array_equal(found, [True, False, False, False, False, False])


def at_border_by(matrix: FloatArray, labels: IntArray, d_c: float) -> Callable[[IndexArray], BoolArray]:
    touches = ((matrix < d_c) & (labels[:, None] != labels[None])).any(axis=1)
    return lambda vertices: np.asarray(touches[vertices])


def test_halo_asked_in_batches_is_the_definition() -> None:
    points = clouds((0, 0), (1.6, 0), (0.6, 1.6), count=150)
    matrix = cdist(points, points)
    rho = counted(matrix, 0.4)
    labels = np.repeat(np.arange(3, dtype=np.int32), 150)
    labels[5] = -1
    other = (labels[None] != labels[:, None]) & (labels[None] >= 0) & (labels[:, None] >= 0)
    touches = ((matrix < 0.8) & other).any(axis=1)
    border_rho = np.array([rho[touches & (labels == k)].max() for k in range(3)])
    expected = np.where(labels >= 0, rho < border_rho[labels], False)
    found = density_peaks.halo(rho, labels, 3, lambda vertices: np.asarray(touches[vertices]))
    np.testing.assert_array_equal(found, expected)


def test_peaks_over_a_dense_border_are_joined_and_over_a_thin_one_stay() -> None:
    """Four bumps on a line; the borders have half, a hundredth and half of the peaks' density."""
    height = np.array([1.0, 0.5, 1.1, 0.01, 1.2, 0.5, 0.9])
    ends = np.stack([np.arange(6), np.arange(1, 7)], axis=1)
    labels = np.array([0, 0, 1, 1, 2, 2, 3], dtype=np.int32)
    candidates = np.array([0, 2, 4, 6])
    centres, joined = density_peaks.persistent_centres(height, labels, candidates, ends, min_prominence=2.0)
    np.testing.assert_array_equal(centres, [2, 4])  # the higher of each pair
    np.testing.assert_array_equal(joined, [0, 0, 0, 0, 1, 1, 1])
    all_four, same = density_peaks.persistent_centres(height, labels, candidates, ends, min_prominence=0.1)
    np.testing.assert_array_equal(all_four, candidates)
    np.testing.assert_array_equal(same, labels)
    three, _ = density_peaks.persistent_centres(
        height, labels, candidates, ends, min_prominence=9.0, n_centres=3
    )
    assert len(three) == 3


def test_clusters_that_do_not_touch_are_never_joined() -> None:
    ends = np.array([[0, 1], [2, 3]])
    labels = np.array([0, 0, 1, 1], dtype=np.int32)
    centres, joined = density_peaks.persistent_centres(
        np.ones(4), labels, np.array([0, 2]), ends, min_prominence=50.0
    )
    np.testing.assert_array_equal(centres, [0, 2])
    np.testing.assert_array_equal(joined, labels)
