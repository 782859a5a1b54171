"""Scales along axes and warp are told from where the shapes lie on each other."""

import numpy as np
import pytest

from pipeline.core.mesh import FloatArray
from pipeline.kernels import rigid, sampling
from pipeline.kernels.similarity import estimate_scale, residual_deformation_mm
from pipeline.kernels.surface import Surface
from tests.support import shapes


@pytest.fixture(scope="module")
def blob() -> Surface:
    return Surface(shapes.bumpy_blob(5))


def points_of(surface: Surface, factors: list[float]) -> FloatArray:
    return sampling.on_surface(surface.mesh, 4000, 0).points * factors


EQUAL = np.full(4000, 1 / 4000)


@pytest.mark.parametrize("factor", [0.99, 1.0, 1.02])
def test_isotropic(blob: Surface, factor: float) -> None:
    T = shapes.motion(1, translation_mm=5.0)
    scan = rigid.transformed(rigid.inverse(T), points_of(blob, [factor] * 3))
    found = estimate_scale(scan, EQUAL, blob, T, 3.0, per_axis=False)
    assert found is not None and found.factors[0] == pytest.approx(factor, abs=1e-4)


def test_per_axis_and_nothing_is_bent(blob: Surface) -> None:
    factors = [0.99, 1.005, 1.02]
    found = estimate_scale(points_of(blob, factors), EQUAL, blob, np.eye(4), 3.0, per_axis=True)
    assert found is not None
    np.testing.assert_allclose(found.factors, factors, atol=3e-4)
    assert residual_deformation_mm(found, EQUAL) < 0.01


def test_warp_is_what_scaling_leaves_and_noise_is_not(blob: Surface) -> None:
    samples = sampling.on_surface(blob.mesh, 4000, 0)
    wave = 0.2 * np.sin(samples.points[:, 0] / 4.0)[:, None] * samples.normals
    noise = np.random.default_rng(0).normal(0, 0.2, 4000)[:, None] * samples.normals

    def warp_of(points: FloatArray) -> float:
        found = estimate_scale(points, EQUAL, blob, np.eye(4), 3.0, per_axis=True)
        assert found is not None
        return residual_deformation_mm(found, EQUAL)

    assert warp_of(samples.points + noise) < 0.06
    assert warp_of(samples.points + wave) == pytest.approx(0.2 / np.sqrt(2), rel=0.25)


def test_a_plane_has_no_size() -> None:
    plane = Surface(shapes.grid_plane(20, 20))
    points = sampling.on_surface(plane.mesh, 4000, 0).points
    assert estimate_scale(points, EQUAL, plane, np.eye(4), 3.0, per_axis=False) is None
