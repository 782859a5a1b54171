"""Closest points and signs against closed forms."""

import numpy as np
import open3d as o3d
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.core.mesh import FloatArray
from pipeline.kernels.native import core
from pipeline.kernels.surface import Surface
from tests.support import shapes
from tests.support.closest_weights import closest_weights

OFFSETS = (0.0, 1e4)  # far from the origin too: single precision must not be spent on the offset


def box_distance(points: FloatArray, half: float) -> FloatArray:
    """Signed distance to the cube [-half, half]^3."""
    beyond = np.abs(points) - half
    outside = np.linalg.norm(np.maximum(beyond, 0), axis=1)
    return outside + np.minimum(beyond.max(axis=1), 0)


@pytest.mark.parametrize("offset", OFFSETS)
def test_signed_distance_to_a_box_is_the_closed_form(offset: float) -> None:
    cube = shapes.box((2.0, 2.0, 2.0))
    moved = type(cube)(cube.vertices - 1.0 + offset, cube.faces)
    points = np.random.default_rng(0).uniform(-2.5, 2.5, (4000, 3))
    surface = Surface(moved)
    found = surface.closest(points + offset)
    np.testing.assert_allclose(
        surface.signed_distance(points + offset, found), box_distance(points, 1.0), atol=1e-9 + 1e-12 * offset
    )


def test_sign_is_right_where_a_corner_is_closest() -> None:
    """At a sharp corner the nearest face's own normal gives the wrong side; the pseudonormal does not."""
    spike = shapes.box((1.0, 1.0, 1.0))
    sheared = type(spike)(spike.vertices @ np.array([[1, 0, 0], [0, 1, 0], [3.0, 0, 1]]), spike.faces)
    surface = Surface(sheared)
    tip = sheared.vertices[7]
    outside = tip + np.random.default_rng(1).normal(size=(500, 3)) * 0.2
    found = surface.closest(outside)
    at_tip = (found.weights == 1).any(axis=1)
    assert at_tip.sum() > 20
    assert (surface.signed_distance(outside, found)[at_tip] > 0).all()


def test_distance_of_a_shifted_plane_is_the_shift() -> None:
    plane = shapes.grid_plane()
    surface = Surface(plane)
    inner = np.array([[3.3, 4.1, 0.7], [5.0, 5.0, -0.25]])
    found = surface.closest(inner)
    np.testing.assert_allclose(surface.signed_distance(inner, found), [0.7, -0.25], atol=1e-12)
    assert not surface.on_open_border(found).any()
    assert surface.on_open_border(surface.closest(np.array([[-1.0, 4.2, 0.3], [20.0, 20.0, 1.0]]))).all()


TRIANGLE_AND_POINT = st.lists(st.floats(-3, 3), min_size=12, max_size=12)


def closest(point: FloatArray, corners: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Of one triangle (3, 3): the closest point, its weights, the distance."""
    target = core.SurfaceTarget(np.ascontiguousarray(corners), np.array([[0, 1, 2]], dtype=np.int32))
    found, _, weights, distance = target.closest(point, None, 1)
    return found, weights, distance


@given(TRIANGLE_AND_POINT)
def test_no_point_of_the_triangle_is_closer(numbers: list[float]) -> None:
    values = np.array(numbers).reshape(4, 3)
    point, corners = values[:1], values[1:]
    found, weights, distance = closest(point, corners)
    assert (weights >= -1e-12).all()
    np.testing.assert_allclose(weights.sum(), 1.0, atol=1e-9)
    np.testing.assert_allclose(weights @ corners, found, atol=1e-9)
    np.testing.assert_allclose(np.linalg.norm(found - point, axis=1), distance, atol=1e-12)
    u, v = (grid.ravel() for grid in np.meshgrid(np.linspace(0, 1, 12), np.linspace(0, 1, 12)))
    inside = u + v <= 1
    others = np.stack([1 - u - v, u, v], axis=1)[inside] @ corners
    assert distance[0] <= np.linalg.norm(others - point, axis=1).min() + 1e-7


@given(TRIANGLE_AND_POINT)
def test_closest_point_is_the_same_by_two_routes(numbers: list[float]) -> None:
    """In C++ and in numpy, degenerate triangles too: the same weights, and the same ones exactly 0."""
    values = np.array(numbers).reshape(4, 3)
    _, weights, _ = closest(values[:1], values[1:])
    by_numpy = closest_weights(values[:1], values[None, 1:])
    np.testing.assert_allclose(weights, by_numpy, rtol=1e-9, atol=1e-12)
    np.testing.assert_array_equal(weights == 0, by_numpy == 0)


def test_threads_change_no_bit() -> None:
    blob = shapes.bumpy_blob(4)
    points = np.random.default_rng(2).normal(size=(20_000, 3)) * 12
    target = core.SurfaceTarget(blob.vertices, blob.faces)
    for a, b in zip(target.closest(points, None, 1), target.closest(points, None, 3), strict=True):
        np.testing.assert_array_equal(a, b)


def test_no_triangle_is_nearer_and_of_equal_ones_the_first_is_found() -> None:
    """Against every triangle, on a box whose edges and corners make ties, in any order of the points."""
    box = shapes.box((10.0, 6.0, 4.0), levels=2)
    rng = np.random.default_rng(3)
    points = np.concatenate([rng.uniform(-3, 13, (200, 3)), box.vertices, box.vertices[:40] * 1.1])
    found = Surface(box).closest(points)
    distance_sq = np.empty((len(points), len(box.faces)))
    for face, corners in enumerate(box.vertices[box.faces]):
        distance_sq[:, face] = closest(points, corners)[2] ** 2
    np.testing.assert_allclose(found.distance**2, distance_sq.min(axis=1), rtol=1e-12, atol=1e-24)
    assert (distance_sq[np.arange(len(points)), found.face] <= distance_sq.min(axis=1) * (1 + 1e-12)).all()
    order = rng.permutation(len(points))
    np.testing.assert_array_equal(Surface(box).closest(points[order]).face, found.face[order])


def test_a_triangle_that_is_taken_for_near_changes_no_bit() -> None:
    box = shapes.box((10.0, 6.0, 4.0), levels=2)
    rng = np.random.default_rng(5)
    points = np.concatenate([rng.uniform(-3, 13, (200, 3)), box.vertices])
    surface, near = Surface(box), rng.integers(len(box.faces), size=200 + len(box.vertices))
    found, again = surface.closest(points), surface.closest(points, near)
    for name in ("point", "face", "weights", "distance", "normal"):
        np.testing.assert_array_equal(getattr(found, name), getattr(again, name))
    with pytest.raises(IndexError, match="near face out of range"):
        surface.closest(points[:1], np.array([len(box.faces)]))


def test_distances_are_those_of_embree() -> None:
    blob = shapes.bumpy_blob(4)
    points = np.random.default_rng(4).normal(size=(5000, 3)) * 12
    scene = o3d.t.geometry.RaycastingScene()
    scene.add_triangles(
        o3d.core.Tensor(blob.vertices.astype(np.float32)), o3d.core.Tensor(blob.faces.astype(np.uint32))
    )
    expected = scene.compute_distance(o3d.core.Tensor(points.astype(np.float32))).numpy()
    np.testing.assert_allclose(Surface(blob).closest(points).distance, expected, atol=2e-5)


def test_a_corner_that_is_none_is_refused() -> None:
    with pytest.raises(IndexError, match="face out of range"):
        core.SurfaceTarget(np.eye(3), np.array([[0, 1, 3]], dtype=np.int32))
