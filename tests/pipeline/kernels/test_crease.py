"""The lifted metric: always a metric, the surface itself where nothing is concave, valleys as walls."""

import numpy as np
import pytest

from pipeline.core.mesh import Mesh
from pipeline.kernels import crease
from pipeline.kernels.diffusion import diffused
from pipeline.kernels.geodesics import GeodesicSolver, edge_lengths
from tests.support import shapes


def test_lifted_edges_are_pythagoras() -> None:
    plane = shapes.grid_plane()
    phi = np.random.default_rng(0).normal(size=len(plane.vertices))
    lifted = crease.lifted_lengths(plane.vertices, plane.faces, phi, 3.0)
    in_four = np.column_stack([plane.vertices, 3.0 * phi])
    np.testing.assert_allclose(lifted, edge_lengths(in_four, plane.faces), rtol=1e-12)
    longest = lifted.max(axis=1)
    assert (lifted.sum(axis=1) - 2 * longest >= -1e-12 * longest).all()  # every triangle is one


def test_without_beta_it_is_the_surface() -> None:
    blob = shapes.bumpy_blob(3)
    lifted = crease.lifted_lengths(blob.vertices, blob.faces, np.arange(len(blob.vertices)), 0.0)
    np.testing.assert_allclose(lifted, edge_lengths(blob.vertices, blob.faces), rtol=1e-12)


@pytest.fixture(scope="module")
def valley() -> Mesh:
    """A plane with a groove of depth 1 along x = 20, smooth and 4 wide."""
    plane = shapes.grid_plane(41, 31)
    z = -np.exp(-(((plane.vertices[:, 0] - 20) / 2.0) ** 2))
    return Mesh(np.column_stack([plane.vertices[:, :2], z]), plane.faces)


def test_crossing_a_valley_costs_and_walking_along_it_does_not(valley: Mesh) -> None:
    phi = crease.concavity(valley, 8.0)
    floor = np.abs(valley.vertices[:, 0] - 20) < 0.5
    assert phi[floor].min() > 0.3 and np.abs(phi[np.abs(valley.vertices[:, 0] - 20) > 15]).max() < 0.1
    plain = GeodesicSolver(valley.vertices, valley.faces)
    lifted = crease.lifted_lengths(valley.vertices, valley.faces, phi, 10.0)
    creased = GeodesicSolver(valley.vertices, valley.faces, lengths=lifted)
    before, beyond = 10 * 31 + 15, 30 * 31 + 15
    depth = phi[floor].mean()
    assert creased.distances(before)[beyond] > plain.distances(before)[beyond] + 1.2 * 10 * depth
    low, high = 20 * 31 + 5, 20 * 31 + 25
    assert creased.distances(low)[high] == pytest.approx(plain.distances(low)[high], rel=0.02)


def test_turning_moving_and_scaling_the_part_only_scales_phi(valley: Mesh) -> None:
    moved = valley.moved(shapes.motion(3))
    larger = Mesh(moved.vertices * 1000, moved.faces)
    np.testing.assert_allclose(
        crease.concavity(larger, 8000.0), 1000 * crease.concavity(valley, 8.0), atol=1e-5
    )
    weights = crease.convexity_weights(valley, 8.0, 0.1)
    np.testing.assert_allclose(crease.convexity_weights(larger, 8000.0, 0.1), 1e6 * weights, rtol=1e-6)


def test_on_a_plane_convexity_is_the_area() -> None:
    plane = shapes.grid_plane()
    np.testing.assert_allclose(
        crease.convexity_weights(plane, 3.0, 0.03), plane.vertex_areas_mm2(), rtol=1e-9
    )


def test_diffusion_keeps_constants_and_area_weighted_sums() -> None:
    blob = shapes.bumpy_blob(3)
    areas = blob.vertex_areas_mm2()
    values = np.column_stack([np.full(len(areas), 7.0), blob.vertices[:, 0]])
    after = diffused(blob, values, 5.0)
    np.testing.assert_allclose(after[:, 0], 7.0, rtol=1e-9)
    np.testing.assert_allclose(areas @ after, areas @ values, rtol=1e-9)
    assert np.ptp(after[:, 1]) < np.ptp(values[:, 1])
