"""Pieces: what hangs together, in meshes and clouds, and sizes that no rotation changes."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import ConvexHull
from scipy.spatial.distance import pdist

from pipeline.core.mesh import Mesh
from pipeline.kernels.pieces import Pieces
from tests.support import shapes
from tests.support.scanners.surroundings import joined
from tests.support.variants import catalogue

BALL, SMALL = shapes.icosphere(10.0, 3), shapes.icosphere(1.0, 2)


def at(mesh: Mesh, x_mm: float) -> Mesh:
    return Mesh(mesh.vertices + np.array([x_mm, 0.0, 0.0]), mesh.faces)


def test_two_balls_are_two_pieces_with_their_areas_and_boxes() -> None:
    both = joined([BALL, at(SMALL, 30.0)])
    pieces = Pieces.of(both)
    assert pieces.count == 2
    np.testing.assert_allclose(pieces.weight, [m.face_areas_mm2().sum() for m in (BALL, SMALL)])
    np.testing.assert_allclose(pieces.diagonals_mm(), [20 * np.sqrt(3), 2 * np.sqrt(3)], rtol=0.02)
    np.testing.assert_allclose(pieces.box_gaps_mm(np.array([True, False])), [0.0, 19.0], atol=0.1)
    assert pieces.largest(0.9).tolist() == [True, False]


def test_points_of_a_cloud_hang_together_as_their_surface_does() -> None:
    both = joined([BALL, at(SMALL, 30.0)])
    pieces = Pieces.of(Mesh(both.vertices))
    assert pieces.count == 2
    assert pieces.weight.tolist() == [len(BALL.vertices), len(SMALL.vertices)]


@settings(max_examples=20)
@given(st.integers(0, 2**31))
def test_a_diameter_is_the_same_in_any_pose_and_that_of_a_ball(seed: int) -> None:
    moved = BALL.moved(shapes.motion(seed))
    (diameter_mm,) = Pieces.of(moved).diameters_mm(moved)
    assert 0.98 * 20.0 <= diameter_mm <= 20.0 + 1e-9
    long = shapes.cylinder(1.0, 40.0).moved(shapes.motion(seed))
    (diameter_mm,) = Pieces.of(long).diameters_mm(long)
    np.testing.assert_allclose(diameter_mm, np.hypot(40.0, 2.0), rtol=0.02)


@settings(max_examples=20)
@given(st.integers(0, 2**31), st.sampled_from(["bracket", "cover", "plate", "crown"]))
def test_the_diameter_of_a_part_is_nearly_the_largest_distance_of_its_corners(seed: int, family: str) -> None:
    part = catalogue.FAMILIES[family](1).mesh()
    corners = part.vertices[ConvexHull(part.vertices).vertices]
    largest_mm = pdist(corners).max()
    moved = part.moved(shapes.motion(seed))
    pair = joined([moved, at(SMALL, 500.0)])
    diameters_mm = Pieces.of(pair).diameters_mm(pair)
    np.testing.assert_allclose(diameters_mm, [largest_mm, 2.0], rtol=0.02)
