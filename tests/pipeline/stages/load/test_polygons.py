"""The triangles of a polygon cover it once, with its orientation, whatever its shape."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from pipeline.core.errors import IndexOutOfRange
from pipeline.core.mesh import FloatArray
from pipeline.stages.load.polygons import triangulated

ELL = np.array([(0, 0), (4, 0), (4, 1), (1, 1), (1, 3), (0, 3)], dtype=float)
#: Seen from its corner 0, a fan would cover what is outside.
ARROW = np.array([(2, 1), (0, 2), (5, 1), (0, 0)], dtype=float)


def area_vector(polygon: FloatArray) -> FloatArray:
    return np.asarray(0.5 * np.cross(polygon, np.roll(polygon, -1, axis=0)).sum(axis=0))


def parts(vertices: FloatArray, faces: np.ndarray) -> FloatArray:
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    return np.asarray(0.5 * np.cross(b - a, c - a))


def placed(flat: FloatArray, turn: int) -> FloatArray:
    return Rotation.random(rng=turn).apply(np.column_stack([flat, np.full(len(flat), 7.0)]))


@pytest.mark.parametrize("flat", [ELL, ELL[::-1], ARROW, ARROW[::-1]], ids=["L", "L back", "arrow", "back"])
@pytest.mark.parametrize("turn", range(3))
def test_a_concave_polygon_is_covered_once(flat: FloatArray, turn: int) -> None:
    vertices = placed(flat, turn)
    faces = triangulated(vertices, np.arange(len(flat)), np.array([len(flat)]))
    whole = area_vector(vertices)
    assert faces.shape == (len(flat) - 2, 3)
    np.testing.assert_allclose(parts(vertices, faces).sum(axis=0), whole, atol=1e-12)
    np.testing.assert_allclose(
        np.linalg.norm(parts(vertices, faces), axis=1).sum(), np.linalg.norm(whole), rtol=1e-12
    )


@given(
    st.integers(0, 9),
    st.lists(st.floats(0.3, 3.0), min_size=3, max_size=12),
)
def test_a_polygon_around_a_point_is_covered_once(turn: int, radii: list[float]) -> None:
    angle = np.linspace(0, 2 * np.pi, len(radii), endpoint=False)
    flat = np.array(radii)[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
    vertices = placed(flat, turn)
    faces = triangulated(vertices, np.arange(len(flat)), np.array([len(flat)]))
    whole = np.linalg.norm(area_vector(vertices))
    np.testing.assert_allclose(np.linalg.norm(parts(vertices, faces), axis=1).sum(), whole, rtol=1e-9)


def test_mixed_polygons_keep_their_order_and_short_ones_have_no_triangle() -> None:
    vertices = np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)], dtype=float)
    corners = np.array([0, 1, 2, 3, 0, 1, 0, 1, 2, 1])
    faces = triangulated(vertices, corners, np.array([4, 2, 3, 1]))
    assert faces.tolist() == [[0, 1, 2], [0, 2, 3], [0, 1, 2]]


def test_a_vertex_that_does_not_exist_is_named_with_its_face() -> None:
    with pytest.raises(IndexOutOfRange, match=r"face 1 .* vertex 9"):
        triangulated(np.zeros((4, 3)), np.array([0, 1, 2, 1, 2, 9]), np.array([3, 3]))
