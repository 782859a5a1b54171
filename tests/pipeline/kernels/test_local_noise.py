"""Noise from the scan alone is what was put in, in any unit and pose."""

import numpy as np
import pytest

from pipeline.core.mesh import FloatArray
from pipeline.kernels import rigid
from pipeline.kernels.local_noise import local_noise_mm
from tests.support import shapes


def noisy_blob(sigma_mm: float) -> FloatArray:
    blob = shapes.bumpy_blob(5)
    noise = np.random.default_rng(3).normal(0.0, sigma_mm, len(blob.vertices))
    return blob.vertices + noise[:, None] * blob.vertex_normals()


@pytest.mark.parametrize("sigma_mm", [0.01, 0.05, 0.2])
def test_it_is_what_was_added(sigma_mm: float) -> None:
    assert local_noise_mm(noisy_blob(sigma_mm), 0) == pytest.approx(sigma_mm, rel=0.12)


def test_a_plane_and_a_paraboloid_have_none() -> None:
    x, y = np.meshgrid(np.linspace(-1, 1, 40), np.linspace(-1, 1, 40))
    for z in (0.3 * x - y, 0.2 * x**2 - 0.1 * x * y):
        points = np.stack([x, y, z], axis=-1).reshape(-1, 3)
        found = local_noise_mm(points, 0)
        assert found is not None and found < 1e-3  # a paraboloid is none in the frame of a tilted patch


def test_it_scales_and_turns_with_the_scan() -> None:
    points = noisy_blob(0.05)
    T = shapes.motion(5)
    once, moved = local_noise_mm(points, 0), local_noise_mm(25.4 * rigid.transformed(T, points), 0)
    assert once is not None and moved == pytest.approx(25.4 * once, rel=1e-6)


def test_few_points_have_no_estimate() -> None:
    assert local_noise_mm(noisy_blob(0.05)[:50], 0) is None


def test_the_other_side_of_a_thin_wall_is_no_neighbour() -> None:
    plane = shapes.grid_plane(40, 40, step_mm=1.0)
    noise = np.random.default_rng(0).normal(0.0, 0.02, (2, len(plane.vertices)))
    up = np.array([0.0, 0.0, 1.0])
    sides = [plane.vertices + n[:, None] * up + z * up for n, z in zip(noise, (0.0, 1.5), strict=True)]
    normals = np.concatenate([np.tile(sign * up, (len(plane.vertices), 1)) for sign in (-1.0, 1.0)])
    assert local_noise_mm(np.concatenate(sides), 0, normals) == pytest.approx(0.02, rel=0.15)
