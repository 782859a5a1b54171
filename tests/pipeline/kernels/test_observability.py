"""Free motions of shapes that have them, by their closed form."""

import numpy as np
import pytest

from pipeline.core.mesh import Mesh
from pipeline.kernels import rigid, sampling
from pipeline.kernels.observability import Observability, effective_count, motion_about, observe
from pipeline.kernels.surface import Surface
from tests.support import shapes


def observed(mesh: Mesh, noise_mm: float = 0.02, limit_mm: float = 0.2) -> Observability:
    samples = sampling.on_surface(mesh, 3000, 0)
    residual = np.random.default_rng(0).normal(0, noise_mm, 3000)
    points, surface = samples.points + residual[:, None] * samples.normals, Surface(mesh)
    weights = np.full(3000, 1 / 3000)

    def cost_mm2(T: np.ndarray) -> float:
        return float((surface.closest(rigid.transformed(T, points)).distance ** 2).mean())

    return observe(points, samples.normals, residual, weights, limit_mm, cost_mm2)


def test_a_part_of_many_shapes_has_none() -> None:
    assert observed(shapes.bumpy_blob(4)).unconstrained == ()


def test_a_plane_slides_twice_and_turns_once() -> None:
    found = observed(shapes.grid_plane(30, 20))
    assert sorted(motion.kind for motion in found.unconstrained) == ["rotation", "translation", "translation"]
    turn = next(motion for motion in found.unconstrained if motion.kind == "rotation")
    np.testing.assert_allclose(np.abs(turn.axis), [0, 0, 1], atol=1e-6)
    np.testing.assert_allclose(found.eigenvalues[:3], 0, atol=1e-9)


def test_a_tube_turns_about_its_axis_and_slides_along_it() -> None:
    """Though its facets notice the turn."""
    found = observed(shapes.cylinder(5.0, 30.0, 64, 30), limit_mm=0.5)
    assert sorted(motion.kind for motion in found.unconstrained) == ["rotation", "translation"]
    for motion in found.unconstrained:
        np.testing.assert_allclose(np.abs(motion.axis), [0, 0, 1], atol=0.05)
        assert np.linalg.norm(motion.point_mm[:2]) < 0.5


@pytest.mark.parametrize("shape", ["torus", "beads"])
def test_a_body_of_revolution_turns_about_its_axis(shape: str) -> None:
    mesh, axis = (shapes.torus(), 2) if shape == "torus" else (shapes.beads(), 0)
    (motion,) = observed(mesh).unconstrained
    assert motion.kind == "rotation"
    np.testing.assert_allclose(motion.axis, np.eye(3)[axis], atol=0.02)
    assert np.linalg.norm(np.delete(motion.point_mm, axis)) < 0.2


def test_a_sphere_turns_about_every_axis() -> None:
    motions = observed(shapes.icosphere(10.0, 4)).unconstrained
    assert [motion.kind for motion in motions] == ["rotation"] * 3
    assert all(np.linalg.norm(motion.point_mm) < 0.5 for motion in motions)


def test_more_noise_makes_a_weak_motion_free() -> None:
    """A tube with a shallow bump: known while the noise is small."""
    tube = shapes.cylinder(5.0, 30.0, 64, 60)
    angle, z = np.arctan2(tube.vertices[:, 1], tube.vertices[:, 0]), tube.vertices[:, 2]
    bump = 1 + 0.08 * np.exp(-(angle**2) / 0.2 - (z - 15) ** 2 / 20)
    mesh = Mesh(tube.vertices * np.column_stack([bump, bump, np.ones_like(bump)]), tube.faces)
    assert observed(mesh, noise_mm=0.02, limit_mm=0.3).unconstrained == ()
    assert len(observed(mesh, noise_mm=3.0, limit_mm=0.3).unconstrained) > 0


def test_correlated_residuals_count_for_less() -> None:
    rng = np.random.default_rng(1)
    points = rng.uniform(0, 30, (4000, 3)) * [1, 1, 0]
    weights = np.full(4000, 1 / 4000)
    alone = effective_count(points, rng.normal(size=4000), weights)
    wave = effective_count(points, np.sin(points[:, 0] / 5), weights)
    assert alone == 300 and wave < 200


def test_a_motion_about_a_point_leaves_it() -> None:
    T = motion_about(np.array([3.0, -2.0, 1.0]), np.array([0.1, 0.2, -0.3, 0, 0, 0]))
    np.testing.assert_allclose(
        rigid.transformed(T, np.array([[3.0, -2.0, 1.0]])), [[3.0, -2.0, 1.0]], atol=1e-12
    )
