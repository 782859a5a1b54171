"""Errors of fits with correlated residuals: closed form for a mean, and noise told from a sloped shape."""

import numpy as np
import pytest

from pipeline.core.mesh import FloatArray
from pipeline.kernels import group_jackknife
from pipeline.kernels.correlated_noise import Noise, noise_of


def test_the_jackknife_of_a_mean_is_the_variance_over_n() -> None:
    values = np.random.default_rng(0).normal(0, 1, 50)
    found = group_jackknife.covariance(np.ones((50, 1)), values, np.ones(50), np.arange(50))
    assert found is not None
    np.testing.assert_allclose(found, values.var(ddof=1) / 50, rtol=5e-3)  # the ridge is 1e-3


def test_values_that_come_four_times_count_once() -> None:
    values = np.random.default_rng(0).normal(0, 1, 50)
    four = np.repeat(values, 4)
    found = group_jackknife.covariance(np.ones((200, 1)), four, np.ones(200), np.repeat(np.arange(50), 4))
    assert found is not None
    np.testing.assert_allclose(found, values.var(ddof=1) / 50, rtol=5e-3)


def test_too_few_groups_and_free_unknowns_have_no_covariance() -> None:
    assert group_jackknife.covariance(np.ones((9, 1)), np.ones(9), np.ones(9), np.zeros(9, int)) is None
    free = np.column_stack([np.ones(50), np.zeros(50)])
    assert group_jackknife.covariance(free, np.ones(50), np.ones(50), np.arange(50)) is None


def plane_noise(values: FloatArray, edge_mm: float = 4.0) -> Noise:
    side = int(np.sqrt(len(values)))
    x, y = np.meshgrid(np.arange(side) + 0.5, np.arange(side) + 0.5)
    points = np.column_stack([x.ravel(), y.ravel(), np.zeros(side**2)])
    return noise_of(points, np.tile([0.0, 0, 1], (side**2, 1)), values + 0.3 * points[:, 0], edge_mm)


def test_a_slope_is_shape_and_independent_noise_has_no_inflation() -> None:
    white = np.random.default_rng(1).normal(0, 0.1, 80**2)
    found = plane_noise(white)
    assert found.values.std() == pytest.approx(0.1, rel=0.03)
    assert found.inflation() == pytest.approx(1.0, abs=0.2)
    assert found.lost == pytest.approx(16 / 13)  # three unknowns for 16 cells


def test_noise_that_is_equal_on_two_by_two_places_has_an_inflation_of_four() -> None:
    coarse = np.random.default_rng(2).normal(0, 0.1, (60, 60))
    found = plane_noise(np.kron(coarse, np.ones((2, 2))).ravel())
    assert found.inflation() == pytest.approx(4.0, rel=0.2)
