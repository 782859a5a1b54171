"""Average geodesic distance against closed forms and against the sum over all vertices."""

import numpy as np
import pytest

from pipeline.core.mesh import FloatArray, Mesh
from pipeline.kernels import average_geodesic
from pipeline.kernels.geodesics import GeodesicSolver
from tests.support import shapes


def average(mesh: Mesh, bases: int = average_geodesic.BASES) -> FloatArray:
    solver = GeodesicSolver(mesh.vertices, mesh.faces)
    return average_geodesic.average_geodesic(mesh.vertices, mesh.vertex_areas_mm2(), solver, bases)


def test_on_a_sphere_it_is_a_quarter_of_the_great_circle() -> None:
    np.testing.assert_allclose(average(shapes.icosphere(10.0, 3)), 10.0 * np.pi / 2, rtol=0.01)


def test_a_few_bases_give_nearly_the_sum_over_all_vertices() -> None:
    blob = shapes.bumpy_blob(3)
    everywhere = average(blob, bases=100 * len(blob.vertices))
    np.testing.assert_allclose(average(blob), everywhere, rtol=0.01)


def test_pieces_do_not_see_each_other() -> None:
    small, large = shapes.icosphere(2.0, 2), shapes.icosphere(10.0, 3)
    both = Mesh(
        np.concatenate([small.vertices + 50.0, large.vertices, [[0.0, 0, 0]]]),
        np.concatenate([small.faces, large.faces + len(small.vertices)]),
    )
    found = average(both)
    np.testing.assert_allclose(found[: len(small.vertices)], np.pi, rtol=0.1)  # 7 bases of its own
    np.testing.assert_allclose(found[len(small.vertices) : -1], 5 * np.pi, rtol=0.01)
    assert found[-1] == 0


def test_ends_of_a_tube_are_farther_from_it_than_its_middle() -> None:
    tube = shapes.cylinder(1.0, 20.0, 16, 41)
    found = average(tube).reshape(16, 41)
    assert (found[:, 20] < found[:, 10]).all()
    assert (found[:, 10] < found[:, 0]).all()
    assert found.min() == pytest.approx(
        20.0 / 4, rel=0.1
    )  # mean of |z - 10| over the tube, a little more around it
