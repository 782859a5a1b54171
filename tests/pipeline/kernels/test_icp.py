"""ICP: the native loops against the same steps in numpy, known motions, and threads."""

import numpy as np
import pytest
from scipy.spatial import cKDTree

from pipeline.core.mesh import FloatArray
from pipeline.kernels import icp, rigid, sampling
from pipeline.kernels.native import core
from pipeline.kernels.surface import Surface
from tests.support import shapes

MAX_MM = 2.0


def step(moved: FloatArray, closest: FloatArray, normals: FloatArray, weights: FloatArray) -> FloatArray:
    """(4, 4) one Gauss-Newton step of point to plane, by least squares on the rows themselves."""
    centre = weights @ moved / weights.sum()
    J = np.column_stack([np.cross(moved - centre, normals), normals]) * np.sqrt(weights)[:, None]
    residual = np.einsum("kd,kd->k", normals, closest - moved) * np.sqrt(weights)
    T = rigid.from_vector(np.linalg.lstsq(J, residual)[0][None])[0]
    return rigid.compose(np.eye(3), centre) @ T @ rigid.compose(np.eye(3), -centre)


def start(seed: int) -> FloatArray:
    """A small motion about the blob."""
    rng = np.random.default_rng(seed)
    return rigid.from_vector(np.concatenate([rng.normal(0, 0.04, 3), rng.normal(0, 0.3, 3)])[None])[0]


def test_steps_to_samples_are_those_of_numpy() -> None:
    blob = shapes.bumpy_blob(4)
    target, source = sampling.on_surface(blob, 3000, 0), sampling.on_surface(blob, 400, 1)
    T = np.array([start(seed) for seed in range(4)])
    sign = np.array([1.0, 1.0, -1.0, 1.0])
    lengths_mm = []
    found, cost = icp.Target(target.points, target.normals).refine_many(
        source.points, source.normals, T, sign, max_distance_mm=MAX_MM, iterations=3
    )
    tree = cKDTree(target.points)
    for pose in (0, 1, 3):
        expected = T[pose]
        for _ in range(3):
            moved = rigid.transformed(expected, source.points)
            distance, index = tree.query(moved)
            agree = (source.normals @ expected[:3, :3].T * target.normals[index]).sum(axis=1) > 0.5
            weights = ((distance < MAX_MM) & agree).astype(np.float64)
            motion = step(moved, target.points[index], target.normals[index], weights)
            lengths_mm.append(rigid.rms_displacement(motion, np.eye(4), moved))
            expected = motion @ expected
        np.testing.assert_allclose(found[pose], expected, atol=1e-6)
        assert cost[pose] < 0.1
    assert max(lengths_mm) < MAX_MM  # so that no step is cut
    np.testing.assert_array_equal(found[2], T[2])  # flipped normals agree with none: nothing moves it
    assert cost[2] == MAX_MM**2


@pytest.mark.parametrize("with_normals", [True, False])
def test_a_known_motion_is_recovered_on_the_surface(with_normals: bool) -> None:
    blob = shapes.bumpy_blob(4)
    samples = sampling.on_surface(blob, 1500, 1)
    weights = np.full(len(samples.points), 1 / len(samples.points))
    T = np.array([start(seed) for seed in range(3)])
    for refined in icp.refine_all(
        *(samples.points, samples.normals if with_normals else None, weights, Surface(blob), T, np.ones(3)),
        max_distance_mm=MAX_MM,
        max_iterations=60,
        tolerance_mm=1e-9,
    ):
        assert refined.converged
        np.testing.assert_allclose(refined.T_target_source, np.eye(4), atol=1e-6)


def test_one_pose_and_many_give_the_same_bits() -> None:
    """One pose spreads its points over the threads, many poses one thread each."""
    blob = shapes.bumpy_blob(4)
    samples = sampling.on_surface(blob, 3000, 1)
    weights, surface = np.full(3000, 1 / 3000), Surface(blob)
    T = np.array([start(seed) for seed in range(3)])
    limits = {"max_distance_mm": MAX_MM, "max_iterations": 7, "tolerance_mm": 1e-12}
    many = icp.refine_all(samples.points, samples.normals, weights, surface, T, np.ones(3), **limits)
    for pose, refined in zip(T, many, strict=True):
        alone = icp.refine(samples.points, samples.normals, weights, surface, pose, **limits)
        np.testing.assert_array_equal(alone.T_target_source, refined.T_target_source)
        assert (alone.converged, alone.iterations) == (refined.converged, refined.iterations)


def test_a_free_motion_stays_zero_and_too_few_pairs_move_nothing() -> None:
    plane = shapes.grid_plane(21, 21)
    samples = sampling.on_surface(plane, 500, 0)
    lifted = rigid.compose(np.eye(3), np.array([0.3, 0.2, 0.5]))
    weights = np.full(500, 1 / 500)
    limits = {"max_distance_mm": MAX_MM, "max_iterations": 20, "tolerance_mm": 1e-9}
    found = icp.refine(samples.points, samples.normals, weights, Surface(plane), lifted, **limits)
    assert found.converged
    np.testing.assert_allclose(found.T_target_source[:3, 3], [0.3, 0.2, 0.0], atol=1e-5)
    far = rigid.compose(np.eye(3), np.array([0.0, 0.0, 100.0]))
    refused = icp.refine(samples.points, samples.normals, weights, Surface(plane), far, **limits)
    assert (refused.converged, refused.iterations) == (False, 1)
    np.testing.assert_array_equal(refused.T_target_source, far)


def test_a_sphere_that_noise_turns_for_ever_has_converged_when_its_cost_no_longer_falls() -> None:
    ball = shapes.icosphere(10.0, 4)
    source = sampling.on_surface(ball, 2000, 1)
    noise = np.random.default_rng(6).normal(0, 0.05, (2000, 1)) * source.normals
    found = icp.refine(
        *(source.points + noise, source.normals, np.full(2000, 1 / 2000), Surface(ball), start(0)),
        max_distance_mm=MAX_MM,
        max_iterations=500,
        tolerance_mm=1e-9,
    )
    assert found.converged and found.iterations < 100
    centre = rigid.transformed(found.T_target_source, np.zeros((1, 3)))
    np.testing.assert_allclose(centre, 0, atol=5 * 0.05 / np.sqrt(2000))  # as well as noise allows


def test_icp_of_the_complete_shape_takes_the_steps_of_the_plain_method() -> None:
    """Besl & McKay's loop, written out with numpy: the closest points, then the best motion to them."""
    blob = shapes.bumpy_blob(3)
    surface, T_start = Surface(blob), rigid.from_vector(np.array([[0.1, -0.05, 0.2, 1.0, 0.5, -0.7]]))[0]
    points = rigid.transformed(T_start, blob.vertices[::7])
    weights = np.random.default_rng(0).random(len(points))
    T = np.eye(4)
    for _ in range(12):
        moved = rigid.transformed(T, points)
        T = rigid.fit(moved, surface.closest(moved).point, weights) @ T
    found = icp.complete_shape(points, weights, surface, max_iterations=12, tolerance_mm=1e-12)
    np.testing.assert_allclose(found.T_target_source, T, atol=1e-9)
    assert found.iterations == 12 and not found.converged
    soon = icp.complete_shape(points, weights, surface, max_iterations=500, tolerance_mm=0.01)
    assert soon.converged and soon.iterations < 500


def tilted_plane(tilt: float) -> tuple[FloatArray, FloatArray]:
    """Points of a plane of 40 mm with normals that lean by random angles (1 sigma, rad), as a mesh makes
    them.
    """
    rng = np.random.default_rng(3)
    points = np.column_stack([rng.uniform(-20, 20, (4000, 2)), np.zeros(4000)])
    normals = np.column_stack([rng.normal(0, tilt, (4000, 2)), np.ones(4000)])
    return points, normals / np.linalg.norm(normals, axis=1, keepdims=True)


@pytest.mark.parametrize("tilt", [1e-5, 1e-4, 1e-3])
def test_a_motion_that_only_noise_holds_leads_no_step_off_the_target(tilt: float) -> None:
    """In the plane nothing holds the points but the lean of the normals: the least squares step is as long as
    noise / (tilt * sqrt(points)), here up to 0.2 / (1e-5 * 12) = 1,700 mm.
    """
    points, normals = tilted_plane(tilt)
    rng = np.random.default_rng(5)
    source = np.column_stack([rng.uniform(-15, 15, (150, 2)), rng.normal(0, 0.2, 150)])
    up = np.tile([0.0, 0.0, 1.0], (150, 1))
    lifted = rigid.compose(np.eye(3), np.array([0.0, 0.0, 0.5]))
    (T,), (cost_mm2,) = icp.Target(points, normals).refine_many(
        source, up, lifted[None], np.ones(1), max_distance_mm=MAX_MM, iterations=1
    )
    assert rigid.rms_displacement(T, lifted, source) <= MAX_MM
    # what the plane does hold is found in that one step: the height, as well as noise allows
    assert abs(rigid.transformed(T, source)[:, 2].mean()) < 5 * 0.2 / np.sqrt(150)
    assert np.sqrt(cost_mm2) < 1.2 * 0.2


@pytest.mark.parametrize("damping", [0.0, -1e-9, np.inf])
def test_no_damping_that_is_given_keeps_a_step_for_ever(damping: float) -> None:
    """Found by fuzzing: nothing times zero grows. Its step is longer than the correspondences reach."""
    points, normals = tilted_plane(1e-5)
    rng = np.random.default_rng(5)
    source = np.column_stack([rng.uniform(-15, 15, (150, 2)), rng.normal(0, 0.2, 150)])
    up = np.tile([0.0, 0.0, 1.0], (150, 1))
    T, _ = core.SampleTarget(points, normals).refine(
        *(source, up, np.eye(4)[None], np.ones(1)),
        max_distance=MAX_MM,
        min_agreement=icp.MIN_AGREEMENT,
        damping=damping,
        iterations=2,
        threads=1,
    )
    assert T.shape == (1, 4, 4)
