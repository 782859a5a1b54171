"""Density peaks on point sets whose answer is known, checked against the formulas written out."""

import numpy as np
from scipy.sparse import csr_matrix
from scipy.spatial.distance import cdist

from pipeline.kernels import density_peaks
from pipeline.kernels.geodesics import density_rank
from pipeline.mesh import FloatArray, IndexArray


def clouds(*centres: tuple[float, float], count: int = 60, seed: int = 0) -> FloatArray:
    rng = np.random.default_rng(seed)
    return np.concatenate([rng.normal(centre, 0.5, (count, 2)) for centre in centres])


def uphill(matrix: FloatArray, rho: FloatArray) -> tuple[IndexArray, FloatArray]:
    rank = density_rank(rho)
    denser = np.where(rank[None, :] < rank[:, None], matrix, np.inf)
    nearest = denser.argmin(axis=1)
    delta = denser.min(axis=1)
    return np.where(np.isfinite(delta), nearest, -1), np.where(np.isfinite(delta), delta, matrix.max())


def test_density_counts_points_strictly_inside_d_c() -> None:
    line = np.abs(np.subtract.outer(np.arange(5.0), np.arange(5.0)))
    rho = density_peaks.local_density(csr_matrix(line), 2.0, np.ones(5))
    np.testing.assert_array_equal(rho, [2, 3, 3, 3, 2])  # neighbours at 1, not those at exactly 2, and itself


def test_three_clouds_give_three_segments() -> None:
    points = clouds((0, 0), (6, 0), (0, 7))
    matrix = cdist(points, points)
    near = csr_matrix(np.where(matrix < 1.0, matrix, 0))
    rho = density_peaks.local_density(near, 1.0, np.ones(len(points)))
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
    rho = density_peaks.local_density(csr_matrix(np.where(matrix < 1.0, matrix, 0)), 1.0, np.ones(len(points)))
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
    positions = np.arange(6.0)
    matrix = np.abs(np.subtract.outer(positions, positions))
    near = csr_matrix(np.where(matrix <= 1.0, matrix, 0))
    rho = np.array([1.0, 5.0, 2.0, 3.0, 6.0, 4.0])
    labels = np.array([0, 0, 0, 1, 1, 1], dtype=np.int32)
    np.testing.assert_array_equal(density_peaks.halo(near, 1.5, rho, labels), [True, False, False, False, False, False])
