"""A bump is found where it is, with its area and height; what is smooth is taken for distortion."""

import numpy as np

from pipeline.kernels import topology
from pipeline.kernels.surface_patches import (
    adjacency_of,
    border_length_mm,
    largest_patch,
    neighbour_means,
    without_low_order,
)
from tests.support import shapes

BALL = shapes.icosphere(10.0, 4)
NEAR, AREAS = adjacency_of(BALL), BALL.vertex_areas_mm2()


def test_the_largest_patch_is_the_cap_that_stands_out() -> None:
    z = BALL.vertices[:, 2]
    values = np.where(z > 8.0, 0.5, 0.0) + np.where(z < -9.5, -2.0, 0.0)
    patch = largest_patch(BALL.vertices, NEAR, AREAS, values, np.abs(values) > 0.1)
    assert patch is not None
    # a cap of height h of a sphere of radius r has the area 2 pi r h (Archimedes)
    np.testing.assert_allclose(patch.area_mm2, 2 * np.pi * 10.0 * 2.0, rtol=0.1)
    assert patch.mean == 0.5
    assert patch.centre_mm[2] > 8.0
    assert largest_patch(BALL.vertices, NEAR, AREAS, values, np.zeros(len(z), dtype=np.bool_)) is None


def test_means_keep_a_constant_and_halve_noise() -> None:
    ones = np.ones(len(BALL.vertices))
    np.testing.assert_allclose(neighbour_means(NEAR, 3.0 * ones, ones, 2), 3.0)
    noise = np.random.default_rng(0).normal(size=len(ones))
    assert neighbour_means(NEAR, noise, ones, 1).std() < 0.5


def test_a_quadratic_distortion_leaves_nothing_and_a_step_stays() -> None:
    p, weights = BALL.vertices, BALL.weights()
    bent = 0.1 + 0.02 * p[:, 0] - 0.003 * p[:, 1] * p[:, 2] + 0.004 * p[:, 0] ** 2
    assert np.abs(without_low_order(p, bent, weights)).max() < 1e-6
    step = np.where(p[:, 0] > 0, 1.0, -1.0) * np.where(np.abs(p[:, 1]) < 3, 1.0, 0.0)
    left = without_low_order(p, step, weights)
    assert np.sqrt((weights * left**2).sum()) > 0.5 * np.sqrt((weights * step**2).sum())


def test_border_length_is_the_rim() -> None:
    assert border_length_mm(BALL.vertices, topology.edges(BALL.faces)) == 0.0
    tube = shapes.cylinder(2.0, 8.0)
    np.testing.assert_allclose(
        border_length_mm(tube.vertices, topology.edges(tube.faces)), 2 * 2 * np.pi * 2.0, rtol=0.01
    )
