"""Edge-path distances: exact along straight lines of edges, and every query agrees with the full matrix."""

import numpy as np
import pytest
from scipy.sparse.csgraph import dijkstra

from pipeline.kernels.geodesics import GeodesicSolver, density_rank
from pipeline.mesh import FloatArray, Mesh
from tests import shapes


def full_matrix(solver: GeodesicSolver) -> FloatArray:
    """The slow route: all pairs, the smaller of both directions."""
    rows = np.stack([solver.distances(i) for i in range(solver.n)])
    return np.asarray(np.minimum(rows, rows.T))


@pytest.fixture(scope="module")
def blob() -> tuple[GeodesicSolver, FloatArray]:
    mesh = shapes.bumpy_blob(levels=3)
    solver = GeodesicSolver(mesh.vertices, mesh.faces)
    return solver, full_matrix(solver)


def two_pieces() -> Mesh:
    one, other = shapes.icosphere(3.0, 2), shapes.icosphere(2.0, 1)
    return Mesh(
        np.concatenate([one.vertices, other.vertices + np.array([20.0, 0, 0])]),
        np.concatenate([one.faces, other.faces + len(one.vertices)]),
    )


def test_distance_along_a_row_of_edges_is_its_length() -> None:
    plane = shapes.grid_plane(12, 9, step_mm=0.5)
    distances = GeodesicSolver(plane.vertices, plane.faces).distances(0)
    np.testing.assert_allclose(distances[:9], 0.5 * np.arange(9), atol=1e-12)
    np.testing.assert_allclose(distances[-1], 0.5 * (3 + 8 * np.sqrt(2)), atol=1e-12)


def test_within_is_the_full_matrix_cut_at_the_radius_and_symmetric(blob: tuple[GeodesicSolver, FloatArray]) -> None:
    solver, matrix = blob
    radius = float(np.quantile(matrix, 0.1))
    pairs = solver.within(radius)
    expected = np.where(matrix <= radius, matrix, 0.0)
    assert (pairs.toarray() == expected).all()
    assert (pairs != pairs.T).nnz == 0
    assert (solver.count_within(radius) == (expected > 0).sum(axis=1)).all()


@pytest.mark.parametrize("q", [1e-6, 0.001, 0.02, 0.5, 1.0])
def test_quantile_is_the_kth_smallest_pair(blob: tuple[GeodesicSolver, FloatArray], q: float) -> None:
    solver, matrix = blob
    pairs = np.sort(matrix[np.triu_indices(solver.n, 1)])
    assert solver.quantile(q) == pairs[max(1, round(q * len(pairs))) - 1]


@pytest.mark.parametrize("levels", [2, 5], ids=["many ties", "few ties"])
def test_nearest_denser_is_the_full_matrix_answer(blob: tuple[GeodesicSolver, FloatArray], levels: int) -> None:
    solver, matrix = blob
    rho = np.round(np.random.default_rng(levels).random(solver.n), levels)
    rank = density_rank(rho)
    index, distance = solver.nearest_denser(rho)
    for i in range(solver.n):
        denser = np.flatnonzero(rank < rank[i])
        if denser.size == 0:
            assert index[i] == -1 and np.isinf(distance[i])
        else:
            assert distance[i] == pytest.approx(matrix[i, denser].min(), rel=1e-12)
            assert rank[index[i]] < rank[i]
            assert matrix[i, index[i]] == pytest.approx(distance[i], rel=1e-12)


def test_pieces_are_infinitely_far_apart_and_counted_last() -> None:
    mesh = two_pieces()
    solver = GeodesicSolver(mesh.vertices, mesh.faces)
    first_of_other = len(shapes.icosphere(3.0, 2).vertices)
    assert np.isinf(solver.distances(0)[first_of_other:]).all()
    assert np.isinf(solver.quantile(1.0))
    assert np.isfinite(solver.quantile(0.02))
    index, distance = solver.nearest_denser(np.arange(solver.n, dtype=np.float64))
    assert (index < 0).sum() == 2 and np.isinf(distance[index < 0]).all()


def test_agrees_with_scipy_on_the_edge_graph() -> None:
    mesh = shapes.torus(around=20, across=10)
    solver = GeodesicSolver(mesh.vertices, mesh.faces)
    n = len(mesh.vertices)
    graph = np.zeros((n, n))
    for a, b in ((0, 1), (1, 2), (2, 0)):
        i, j = mesh.faces[:, a], mesh.faces[:, b]
        graph[i, j] = graph[j, i] = np.linalg.norm(mesh.vertices[i] - mesh.vertices[j], axis=1)
    np.testing.assert_allclose(full_matrix(solver), dijkstra(graph), rtol=1e-12)


def test_distance_from_a_set_is_the_smallest_of_its_members(blob: tuple[GeodesicSolver, FloatArray]) -> None:
    solver, matrix = blob
    sources = np.array([3, 77, 200])
    np.testing.assert_allclose(solver.distances_from_set(sources), matrix[sources].min(axis=0), rtol=1e-12)
    assert np.isinf(solver.distances_from_set(np.zeros(0, dtype=np.int64))).all()
