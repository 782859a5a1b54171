"""Tops before the rest, coarse before fine, and strengths that say so."""

import numpy as np

from pipeline.kernels import maxima
from tests.support import shapes


def test_a_bump_on_a_plane_is_the_only_top() -> None:
    plane = shapes.grid_plane(12, 9)
    field = -np.linalg.norm(plane.vertices - plane.vertices[40], axis=1)
    tops = maxima.local_maxima(field, maxima.ring(plane.faces, len(field)))
    np.testing.assert_array_equal(np.flatnonzero(tops), [40])


def test_of_two_equal_neighbours_the_first_is_the_top() -> None:
    plane = shapes.grid_plane(12, 9)
    field = np.zeros(len(plane.vertices))
    field[[40, 41]] = 1.0
    tops = maxima.local_maxima(field, maxima.ring(plane.faces, len(field)))
    assert tops[40]
    assert not tops[41]


def test_a_vertex_without_neighbours_or_without_a_value_is_no_top() -> None:
    plane = shapes.grid_plane(5, 5)
    field = np.zeros(26)
    field[25], field[12], field[11] = 9.0, 3.0, -np.inf
    tops = maxima.local_maxima(field, maxima.ring(plane.faces, 26))
    assert tops[12]
    assert not tops[[11, 25]].any()


def test_rounding_errors_on_a_flat_field_are_no_tops_and_change_no_order() -> None:
    plane = shapes.grid_plane(12, 9)
    near = maxima.ring(plane.faces, len(plane.vertices))
    flat = 1.0 + np.random.default_rng(0).normal(0, 1e-16, len(plane.vertices))
    tops = maxima.local_maxima(flat, near)
    assert not tops.any()
    np.testing.assert_array_equal(maxima.ranked(flat, tops).vertex, np.arange(len(flat)))


def test_two_rings_hold_what_is_two_edges_away() -> None:
    sphere = shapes.icosphere(1.0, 3)
    near = maxima.ring(sphere.faces, len(sphere.vertices), rings=2)
    around = np.bincount(near.of)
    assert around.min() == 15  # about the 12 vertices with five triangles
    assert around.max() == 18
    assert (np.bincount(maxima.ring(sphere.faces, len(sphere.vertices)).of) <= 6).all()


def test_tops_come_before_the_rest_and_strength_falls() -> None:
    field = np.array([0.0, 5.0, 4.0, -np.inf, 2.0, 3.0])
    tops = np.array([False, True, False, False, True, False])
    found = maxima.ranked(field, tops)
    np.testing.assert_array_equal(found.vertex, [1, 4, 2, 5, 0])
    np.testing.assert_allclose(found.strength, [1.5, 1.2, 0.4, 0.3, 0.0])


def test_a_coarse_top_comes_before_a_higher_fine_one() -> None:
    fields = np.array([[1.0, 1.0], [3.0, 2.0], [2.0, 9.0], [0.0, 5.0]])
    tops = np.array([[False, False], [True, False], [False, True], [False, False]])
    found = maxima.coarse_to_fine(fields, tops)
    np.testing.assert_array_equal(found.vertex, [1, 2, 3, 0])
    assert (np.diff(found.strength) < 0).all()
