"""Poses that are made from others: nudged, repeated, and told apart up to the design's symmetries."""

import numpy as np
import pytest

from pipeline.kernels import poses, rigid
from tests.support import shapes


def test_a_nudge_moves_the_points_by_what_was_asked() -> None:
    points, T = shapes.bumpy_blob(3).vertices, shapes.motion(1)
    found = poses.perturb(T, points, [0.5, 2.0])
    assert found.shape == (24, 4, 4)
    moved = [rigid.rms_displacement(each, T, points) for each in found]
    assert moved == pytest.approx([0.5] * 12 + [2.0] * 12, rel=0.01)  # a turn moves along an arc
    apart = [rigid.rms_displacement(a, b, points) for k, a in enumerate(found[:12]) for b in found[:k]]
    assert min(apart) > 0.5


def test_powers_of_a_quarter_turn_come_back() -> None:
    turn = np.array([[0.0, -1, 0, 3], [1, 0, 0, -2], [0, 0, 1, 0], [0, 0, 0, 1]])
    once, twice, thrice, four, *back = poses.iterate_motion(turn, 4)
    np.testing.assert_allclose(once, turn, atol=1e-12)
    np.testing.assert_allclose(twice, turn @ turn, atol=1e-12)
    np.testing.assert_allclose(four, np.eye(4), atol=1e-12)
    np.testing.assert_allclose(back[0], thrice, atol=1e-12)  # one back is three forth


def test_of_poses_that_a_symmetry_makes_alike_one_is_kept() -> None:
    points, half_turn = shapes.bumpy_blob(3).vertices, np.diag([-1.0, -1.0, 1.0, 1.0])
    first, other = shapes.motion(1), shapes.motion(2)
    T, order = np.array([first, half_turn @ first, other, half_turn @ other]), np.arange(4)
    assert poses.distinct(T, order, points, 1.0, 4).tolist() == [0, 1, 2, 3]
    assert poses.distinct(T, order, points, 1.0, 4, [half_turn]).tolist() == [0, 2]
    assert poses.distinct(T, order[::-1], points, 1.0, 1, [half_turn]).tolist() == [3]
