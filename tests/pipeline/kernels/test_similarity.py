"""Scales along axes and warp are told from where the shapes lie on each other."""

import numpy as np
import pytest

from pipeline.core.mesh import FloatArray, Mesh
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
    found = estimate_scale(points, EQUAL, plane, np.eye(4), 3.0, per_axis=False)
    assert found is not None and np.isnan(found.factors).all() and np.isnan(found.standard_error).all()


def test_a_block_printed_short_on_z_is_short_on_z_alone() -> None:
    block = Surface(shapes.box((40.0, 30.0, 20.0), 4))
    samples = sampling.on_surface(block.mesh, 4000, 0)
    found = estimate_scale(
        *(samples.points * [1, 1, 0.99], EQUAL, block, np.eye(4), 3.0), per_axis=True, normals=samples.normals
    )
    assert found is not None
    np.testing.assert_allclose(found.factors, [1, 1, 0.99], atol=1e-6)
    assert found.standard_error.max() < 1e-6


@pytest.mark.parametrize(("sides", "known"), [((2,), ""), ((1, 2), ""), ((0, 1), "z")])
def test_walls_that_are_seen_from_one_side_have_no_size_across(sides: tuple[int, ...], known: str) -> None:
    """sides: axes whose upper walls alone are seen; of the others both are. Noise is not size."""
    block = Surface(shapes.box((40.0, 30.0, 20.0), 4))
    samples = sampling.on_surface(block.mesh, 8000, 0)
    seen = np.all([samples.normals[:, axis] >= 0 for axis in sides], axis=0)
    if known == "":
        seen &= samples.normals[:, list(sides)].any(axis=1)  # and nothing but these walls
    noise = np.random.default_rng(1).normal(0, 0.1, (seen.sum(), 1))
    points, normals = samples.points[seen], samples.normals[seen]
    found = estimate_scale(
        *(points + noise * normals, np.ones(len(points)), block, np.eye(4), 3.0),
        per_axis=True,
        normals=normals,
    )
    assert found is not None
    assert [axis for axis, each in zip("xyz", found.factors, strict=True) if np.isfinite(each)] == list(known)


def test_a_ball_has_a_size_though_it_may_turn() -> None:
    ball = Surface(shapes.icosphere(10.0, 4))
    found = estimate_scale(points_of(ball, [1.01] * 3), EQUAL, ball, np.eye(4), 1.0, per_axis=False)
    assert found is not None and found.factors[0] == pytest.approx(1.01, abs=1e-4)


def test_95_percent_intervals_hold_the_size_of_19_of_20_random_parts(blob: Surface) -> None:
    """Noise of single vertices and of whole neighbourhoods in turn, on a blob and on a flat block."""
    inside = []
    for design in (blob, Surface(shapes.box((60.0, 40.0, 8.0), 4))):
        mesh, sigma_mm = design.mesh, 1e-3 * design.mesh.diagonal_mm
        waves_mm = 0.05 * mesh.diagonal_mm
        for seed in range(25):
            rng = np.random.default_rng(seed)
            factors, noise = 1 + rng.uniform(-0.02, 0.02, 3), rng.normal(0, sigma_mm, len(mesh.vertices))
            if seed % 2:
                directions = rng.normal(0, 2 / waves_mm, (60, 3))  # a smooth random field
                phases = mesh.vertices @ directions.T + rng.uniform(0, 2 * np.pi, 60)
                noise = sigma_mm * np.sqrt(2 / 60) * np.cos(phases).sum(axis=1)
            scan = Mesh(mesh.vertices * factors + noise[:, None] * mesh.vertex_normals(), mesh.faces)
            samples = sampling.on_surface(scan, 4000, seed)
            found = estimate_scale(
                *(samples.points, EQUAL, design, np.eye(4), 3.0), per_axis=True, normals=samples.normals
            )
            assert found is not None
            inside.append(np.abs(found.factors - factors) <= 1.96 * found.standard_error)
    assert 0.9 <= np.mean(inside) <= 0.99
