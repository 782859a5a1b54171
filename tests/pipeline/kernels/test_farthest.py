"""Farthest points: no other vertex was farther from those before."""

import numpy as np

from pipeline.core.mesh import Mesh
from pipeline.kernels.farthest import Spread, farthest_points
from pipeline.kernels.geodesics import GeodesicSolver
from tests.support import shapes


def spread(mesh: Mesh, count: int) -> Spread:
    solver = GeodesicSolver(mesh.vertices, mesh.faces)
    areas = mesh.vertex_areas_mm2()
    return farthest_points(mesh.vertices, areas, solver, count, areas > 0)


def test_each_next_point_is_the_farthest_from_those_before() -> None:
    blob = shapes.bumpy_blob(3)
    found = spread(blob, 25)
    rows = GeodesicSolver(blob.vertices, blob.faces).distances(found.taken)
    for number in range(1, 25):
        before = rows[:number].min(axis=0)
        assert found.taken[number] == before.argmax()
        np.testing.assert_allclose(found.reach_mm[number], before.max())
    assert (np.diff(found.reach_mm) <= 0).all()
    np.testing.assert_allclose(found.distance_mm, rows.min(axis=0))


def test_two_points_of_a_sphere_are_opposite() -> None:
    sphere = shapes.icosphere(3.0, 3)
    found = spread(sphere, 2)
    np.testing.assert_allclose(sphere.vertices[found.taken].sum(axis=0), 0, atol=1e-9)
    np.testing.assert_allclose(found.reach_mm, [np.inf, 3 * np.pi], rtol=0.01)


def test_every_piece_gets_a_point_the_largest_first() -> None:
    small, large = shapes.icosphere(1.0, 1), shapes.icosphere(5.0, 2)
    both = Mesh(
        np.concatenate([small.vertices + 20.0, large.vertices, [[99.0, 0, 0]]]),
        np.concatenate([small.faces, large.faces + len(small.vertices)]),
    )
    found = spread(both, 4)
    of_small = found.taken < len(small.vertices)
    np.testing.assert_array_equal(of_small, [False, True, False, False])


def test_it_ends_when_every_vertex_is_taken() -> None:
    found = spread(shapes.icosphere(1.0, 0), 100)
    assert sorted(found.taken) == list(range(12))
