"""The greedy choice against the conditional variance of dense linear algebra."""

import numpy as np
import pytest
from scipy.sparse import csr_matrix

from pipeline.core.mesh import FloatArray
from pipeline.kernels import gp_landmarks
from tests.support import shapes


@pytest.fixture(scope="module")
def process() -> tuple[csr_matrix, FloatArray]:
    blob = shapes.bumpy_blob(3)
    phi = gp_landmarks.heat_factor(blob.vertices, 30.0)
    return phi, np.random.default_rng(0).uniform(0.2, 2.0, len(blob.vertices))


def test_every_choice_has_the_largest_conditional_variance(process: tuple[csr_matrix, FloatArray]) -> None:
    phi, weights = process
    found = gp_landmarks.most_uncertain(phi, weights, 30)
    dense = phi.toarray()
    kernel = dense @ np.diag(weights) @ dense
    for number in range(1, 31):
        taken = found.taken[:number]
        across = kernel[taken]
        variance = np.diag(kernel) - np.einsum(
            "kn,kn->n", across, np.linalg.solve(kernel[np.ix_(taken, taken)], across)
        )
        if number < 30:
            assert variance[found.taken[number]] == pytest.approx(variance.max(), rel=1e-6)
            assert found.variance[number] == pytest.approx(variance.max(), rel=1e-6)
    np.testing.assert_allclose(found.left, variance, atol=1e-8 * kernel.max())


def test_uncertainty_falls(process: tuple[csr_matrix, FloatArray]) -> None:
    phi, weights = process
    found = gp_landmarks.most_uncertain(phi, weights, 60)
    assert (np.diff(found.variance) <= 0).all()
    assert len(np.unique(found.taken)) == 60
    assert (found.left[found.taken] == 0).all()
    assert found.left.max() <= found.variance[-1]


def test_it_ends_when_nothing_is_uncertain() -> None:
    points = np.array([[0.0, 0, 0], [0, 0, 0], [9, 0, 0]])
    found = gp_landmarks.most_uncertain(gp_landmarks.heat_factor(points, 1.0), np.ones(3), 3)
    np.testing.assert_array_equal(found.taken, [0, 2])


def test_weights_follow_curvature_and_a_flat_surface_weighs_by_area() -> None:
    areas = np.array([1.0, 1.0, 2.0])
    curved = gp_landmarks.curvature_weights(areas, np.array([0.0, -3.0, 1.0]), np.array([1.0, 0.0, -1.0]))
    np.testing.assert_allclose(
        curved, areas * (0.5 * np.array([0, 0.75, 0.25]) + 0.5 * np.array([0.5, 0, 0.5]))
    )
    flat = gp_landmarks.curvature_weights(areas, np.zeros(3), np.zeros(3))
    np.testing.assert_allclose(flat / flat.sum(), areas / areas.sum())


def test_the_factor_is_symmetric_with_the_gaussian_of_straight_distances() -> None:
    blob = shapes.bumpy_blob(3)
    phi = gp_landmarks.heat_factor(blob.vertices, 20.0)
    assert abs(phi - phi.T).max() == 0
    i, j = 5, int(phi[[5]].indices[3])
    assert phi[i, j] == pytest.approx(np.exp(-np.sum((blob.vertices[i] - blob.vertices[j]) ** 2) / 20.0))
