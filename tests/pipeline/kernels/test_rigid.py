"""Motions: exact inverses, recovery of a known one, and small-angle steps that stay rotations."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from pipeline.kernels import rigid
from tests.support import shapes

SEEDS = range(4)


@pytest.mark.parametrize("seed", SEEDS)
def test_inverse_undoes_the_motion(seed: int) -> None:
    T = shapes.motion(seed)
    np.testing.assert_allclose(rigid.inverse(T) @ T, np.eye(4), atol=1e-12)


@pytest.mark.parametrize("seed", SEEDS)
def test_fit_recovers_a_known_motion(seed: int) -> None:
    points = np.random.default_rng(seed).normal(size=(7, 3))
    T = shapes.motion(seed)
    found = rigid.fit(points, rigid.transformed(T, points), np.arange(1.0, 8.0))
    np.testing.assert_allclose(found, T, atol=1e-10)


def test_fit_never_reflects() -> None:
    points = np.random.default_rng(0).normal(size=(9, 3))
    assert np.linalg.det(rigid.fit(points, points * [-1, 1, 1])[:3, :3]) == pytest.approx(1.0)


@given(st.lists(st.floats(-3, 3), min_size=6, max_size=6))
def test_from_vector_is_scipys_rotation(numbers: list[float]) -> None:
    T = rigid.from_vector(np.array(numbers)[None])[0]
    np.testing.assert_allclose(T[:3, :3], Rotation.from_rotvec(numbers[:3]).as_matrix(), atol=1e-9)
    np.testing.assert_allclose(T[:3, 3], numbers[3:])


@pytest.mark.parametrize("angle", [0.0, 1e-6, 30.0, 179.9999, 180.0])
def test_angle_is_the_angle(angle: float) -> None:
    T = np.eye(4)
    T[:3, :3] = Rotation.from_rotvec(np.array([0.6, 0.0, 0.8]) * angle, degrees=True).as_matrix()
    assert rigid.angle_deg(T) == pytest.approx(angle, abs=1e-9)


def test_transformed_takes_one_motion_or_many() -> None:
    points = np.random.default_rng(1).normal(size=(5, 3))
    many = np.stack([shapes.motion(seed) for seed in SEEDS])
    together = rigid.transformed(many, points)
    for number, T in enumerate(many):
        np.testing.assert_allclose(together[number], rigid.transformed(T, points), atol=1e-12)
        np.testing.assert_allclose(together[number, 0], (T @ np.append(points[0], 1))[:3], atol=1e-12)


def test_rms_displacement_of_a_shift_is_its_length() -> None:
    shift = np.eye(4)
    shift[:3, 3] = [3.0, 0.0, 4.0]
    assert rigid.rms_displacement(np.eye(4), shift, np.zeros((4, 3))) == pytest.approx(5.0)


def test_orthonormal_removes_drift_and_keeps_det_one() -> None:
    T = shapes.motion(3)
    drifted = T.copy()
    drifted[:3, :3] *= 1 + 1e-6
    np.testing.assert_allclose(rigid.orthonormal(drifted), T, atol=1e-9)
