"""Chords: no face of a box is one, every face of a ball is, and how far off a chord the part may lie."""

import numpy as np

from pipeline.core.mesh import Mesh
from pipeline.kernels import topology
from pipeline.kernels.chords import MAX_DEPTH_RATIO, Chords
from tests.support import shapes


def chords_of(mesh: Mesh) -> Chords:
    return Chords.of(mesh, topology.edges(mesh.faces))


def test_flat_faces_of_a_box_are_exact_and_the_triangles_of_a_ball_are_chords() -> None:
    assert not chords_of(shapes.box((30.0, 20.0, 12.0))).is_chord.any()
    assert chords_of(shapes.icosphere(20.0, 3)).is_chord.all()


def test_flat_faces_stay_exact_in_any_pose_and_beside_a_crease() -> None:
    box = shapes.subdivided(shapes.box((30.0, 20.0, 12.0))).moved(shapes.motion(3, translation_mm=40.0))
    assert not chords_of(box).is_chord.any()


def test_a_chord_explains_what_is_not_deeper_than_it_is_long_by_much() -> None:
    ball = shapes.icosphere(20.0, 3)
    chords = chords_of(ball)
    corners = ball.vertices[ball.faces[:1]]
    longest_mm = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max()
    np.testing.assert_allclose(chords.longest_mm[0], longest_mm)
    face = np.zeros(2, dtype=np.int64)
    near_and_far = longest_mm * MAX_DEPTH_RATIO * np.array([0.99, 1.01])
    assert chords.may_explain(face, near_and_far).tolist() == [True, False]
    flat = chords_of(shapes.box((30.0, 20.0, 12.0)))
    assert not flat.may_explain(face, np.array([0.01, 0.02])).any()
