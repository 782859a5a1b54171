"""Every query of the geodesics is what the full matrix of distances says."""

import numpy as np
import pytest

from pipeline.core.mesh import FloatArray, Mesh
from pipeline.kernels.geodesics import GeodesicSolver, density_rank, rounded
from tests.support import shapes
from tests.support.geodesics import canonical_matrix, rough_blob, solver_of, torn, two_pieces


@pytest.fixture(scope="module")
def rough() -> Mesh:
    return rough_blob()


@pytest.fixture(scope="module", params=["rough", "torn", "pieces", "cube", "plane"])
def known(request: pytest.FixtureRequest, rough: Mesh) -> tuple[GeodesicSolver, FloatArray]:
    """Cube and plane have many equal distances."""
    meshes = {"rough": rough, "torn": torn(rough, 3), "pieces": two_pieces()}
    meshes |= {"cube": shapes.box((2.0, 2.0, 2.0), 3), "plane": shapes.grid_plane(16, 13)}
    solver = solver_of(meshes[request.param])
    return solver, canonical_matrix(solver)


@pytest.mark.parametrize("share", [0.02, 0.3])
def test_within_is_the_matrix_cut_at_the_radius(
    known: tuple[GeodesicSolver, FloatArray], share: float
) -> None:
    solver, matrix = known
    radius = float(np.quantile(matrix[np.isfinite(matrix)], share))
    pairs = solver.within(radius)
    np.testing.assert_array_equal(pairs.toarray(), np.where(matrix <= radius, matrix, 0.0))
    assert (pairs != pairs.T).nnz == 0
    np.testing.assert_array_equal(solver.count_within(radius), (matrix <= radius).sum(axis=1) - 1)


@pytest.mark.parametrize("q", [1e-6, 0.001, 0.02, 0.5, 1.0])
def test_quantile_is_the_kth_smallest_pair(known: tuple[GeodesicSolver, FloatArray], q: float) -> None:
    solver, matrix = known
    pairs = np.sort(matrix[np.triu_indices(solver.n, 1)])
    assert solver.quantile(q) == pairs[max(1, round(q * len(pairs))) - 1]


def test_density_is_the_matrix_sum(known: tuple[GeodesicSolver, FloatArray]) -> None:
    solver, matrix = known
    weights = np.random.default_rng(0).random(solver.n)
    d_c, rho = solver.cutoff_density(0.02, weights)
    np.testing.assert_array_equal(rho, rounded((matrix < d_c) @ weights))
    np.testing.assert_array_equal(solver.density(d_c, weights), rho)
    gaussian = np.where(matrix < 3 * d_c, np.exp(-((matrix / d_c) ** 2)), 0.0) @ weights
    np.testing.assert_allclose(solver.density(d_c, weights, gaussian=True), gaussian, rtol=1e-10)


@pytest.mark.parametrize("digits", [1, 6], ids=["many ties", "few ties"])
def test_nearest_denser_is_the_matrix_answer(known: tuple[GeodesicSolver, FloatArray], digits: int) -> None:
    solver, matrix = known
    rho = np.round(np.random.default_rng(digits).random(solver.n), digits)
    rank = density_rank(rho)
    denser = np.where(rank[None, :] < rank[:, None], matrix, np.inf)
    index, distance = solver.nearest_denser(rho)
    np.testing.assert_array_equal(distance, denser.min(axis=1))
    np.testing.assert_array_equal(index, np.where(np.isfinite(distance), denser.argmin(axis=1), -1))


def test_nearest_other_is_the_matrix_answer(known: tuple[GeodesicSolver, FloatArray]) -> None:
    solver, matrix = known
    labels = np.random.default_rng(2).integers(-1, 3, solver.n).astype(np.int32)
    radius = float(np.quantile(matrix[np.isfinite(matrix)], 0.05))
    other = (labels[None, :] >= 0) & (labels[None, :] != labels[:, None])
    expected = np.where(other & (matrix < radius), matrix, np.inf).min(axis=1)
    np.testing.assert_array_equal(solver.nearest_other(np.arange(solver.n), labels, radius), expected)


def test_distance_from_a_set_is_the_smallest_of_its_members(known: tuple[GeodesicSolver, FloatArray]) -> None:
    solver, matrix = known
    sources = np.array([3, 77, 160])
    np.testing.assert_allclose(
        solver.distances_from_set(sources), matrix[sources].min(axis=0), rtol=1e-9, atol=1e-12
    )
    assert np.isinf(solver.distances_from_set(np.zeros(0, dtype=np.int64))).all()


def test_pieces_are_infinitely_far_apart_and_counted_last() -> None:
    solver = solver_of(two_pieces())
    first_of_other = len(shapes.icosphere(3.0, 2).vertices)
    assert np.isinf(solver.distances(0)[first_of_other:]).all()
    assert np.isinf(solver.quantile(1.0))
    assert np.isfinite(solver.quantile(0.02))
