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


def test_distinct_poses_are_those_of_every_comparison() -> None:
    """The second opinion compares every two poses with numpy."""
    rng = np.random.default_rng(3)
    T = rigid.from_vector(rng.normal(0, 0.2, (120, 6)))
    sign = np.where(rng.random(120) < 0.5, 1.0, -1.0)
    probes, order, apart_mm = rng.normal(size=(8, 3)), rng.permutation(120), 0.5
    kept: list[int] = []
    for number in order:
        rms_mm = [rigid.rms_displacement(T[number], T[other], probes) for other in kept]
        alike = [rms < apart_mm and sign[number] == sign[k] for rms, k in zip(rms_mm, kept, strict=True)]
        if not any(alike):
            kept.append(int(number))
    assert poses.distinct(T, order, probes, apart_mm, 120, (), sign).tolist() == kept
    assert 20 < len(kept) < 110
    assert poses.distinct(T, order, probes, apart_mm, 7, (), sign).tolist() == kept[:7]


def test_pairs_that_agree_are_those_of_every_comparison() -> None:
    """The second opinion compares every two correspondences with numpy, by the rules of the docstring."""
    rng = np.random.default_rng(4)
    blob = shapes.bumpy_blob(3)
    vertex = rng.integers(0, len(blob.vertices), 60)
    p, n = blob.vertices[vertex], blob.vertex_normals()[vertex]
    T = shapes.motion(5)
    q, m = rigid.transformed(T, p) + rng.normal(0, 0.3, p.shape), rigid.rotated(T[:3, :3], n)
    wrong = rng.random(60) < 0.3
    q[wrong], m[wrong] = q[rng.permutation(60)][wrong], m[rng.permutation(60)][wrong]
    agree: list[tuple[float, int, int]] = []
    for i in range(60):
        for j in range(i + 1, 60):
            d, e = p[j] - p[i], q[j] - q[i]
            error = abs(np.linalg.norm(d) - np.linalg.norm(e))
            if error > 1.0 or min(np.linalg.norm(d), np.linalg.norm(e)) < 3.0:
                continue
            u, v = d / np.linalg.norm(d), e / np.linalg.norm(e)
            worst = max(abs(n[i] @ n[j] - m[i] @ m[j]), abs(n[i] @ u - m[i] @ v), abs(n[j] @ u - m[j] @ v))
            tilts = [np.linalg.norm(np.cross(a, b)) for a, b in ((n[i] + n[j], u), (m[i] + m[j], v))]
            if worst <= poses.MAX_ANGLE_COS and min(tilts) > poses.MIN_TILT:
                agree.append((worst / poses.MAX_ANGLE_COS + error / 1.0, i, j))
    best = [pair[1:] for pair in sorted(agree)][:40]
    found = poses.from_oriented_pairs(
        (p, n), (q, m), length_tolerance_mm=1.0, min_length_mm=3.0, max_pairs=40
    )
    assert len(agree) > 100
    middle = np.array([(p[i] + p[j]) / 2 for i, j in best])
    onto = np.array([(q[i] + q[j]) / 2 for i, j in best])
    np.testing.assert_allclose(
        np.einsum("kij,kj->ki", found[:, :3, :3], middle) + found[:, :3, 3], onto, atol=1e-9
    )
