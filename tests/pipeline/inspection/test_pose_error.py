"""The error of an alignment: closed form for reference points, scatter of repeated scans for a best fit."""

import numpy as np
import pytest

from pipeline.core.acceptance import DistanceLimits
from pipeline.core.alignment import RpsFit
from pipeline.core.mesh import FloatArray, Mesh
from pipeline.inspection.aligned_points import fit_reference_points
from pipeline.inspection.patches import Value, median_of
from pipeline.inspection.points import MeasuredPoint, off_nominal
from pipeline.inspection.pose_error import PoseError, of_point_fit, of_surface_fit
from tests.pipeline.inspection.test_alignment import BLOCK, placed, rps_points
from tests.support import shapes

UP = np.array([[0.0, 0.0, 1.0]])
BLOB = shapes.bumpy_blob(5)


def three_two_one() -> tuple[FloatArray, FloatArray]:
    places = [[-10, -10, 0], [10, -10, 0], [0, 10, 0], [-10, 0, 0], [10, 0, 0], [0, 0, 0]]
    directions = [[0, 0, 1]] * 3 + [[0, 1, 0]] * 2 + [[1, 0, 0]]
    return np.array(places, dtype=float), np.array(directions, dtype=float)


def test_errors_of_reference_points_are_levered_out() -> None:
    """Over the middle of three supports the errors average; beyond two of them they grow with the lever."""
    found = of_point_fit(*three_two_one(), np.full(6, 0.01))
    assert found is not None
    middle = np.array([[0.0, -10 / 3, 0.0]])
    np.testing.assert_allclose(found.at(middle, UP), 0.01 / np.sqrt(3))
    np.testing.assert_allclose(found.at(np.array([[30.0, -10, 0]]), UP), 0.01 * np.hypot(2, 1))
    np.testing.assert_allclose(found.at(np.array([[0.0, 30, 0]]), UP), 0.01 * np.sqrt(4 + 0.25 + 0.25))


def test_points_that_leave_a_motion_free_have_no_error() -> None:
    places, directions = three_two_one()
    assert of_point_fit(places[:5], directions[:5], np.ones(5)) is None


def test_a_translation_does_not_change_a_distance_and_a_shift_of_a_plane_is_its_error() -> None:
    shifted = np.zeros((6, 6))
    shifted[5, 5] = 0.02**2
    pose = PoseError(shifted, np.zeros(3))
    exact = Value(0.0, 0.0, 10)
    top, below = (
        MeasuredPoint(np.array([1.0, 2, z]), np.array([0, 0, side]), exact)
        for z, side in ((5.0, 1.0), (0.0, -1.0))
    )
    limits = DistanceLimits(name="height", first="top", second="below", tolerance_mm=1.0)
    found = off_nominal(limits, {"top": top, "below": below}, pose)
    assert found is not None and found[1] == pytest.approx(0.0, abs=1e-12)
    np.testing.assert_allclose(pose.at(top.position_mm[None], top.normal[None]), 0.02)


def test_the_errors_of_the_medians_move_an_rps_alignment() -> None:
    """25 scans with noise, few vertices at each point: 95 % intervals far from them hold 0."""
    place, normal = np.array([[40.0, 30, 20]]), np.array([[0.0, 0, 1]])
    moved, errors = [], []
    for seed in range(25):
        noise = noise_of_scan(BLOCK, 0.02, seed)
        scan = Mesh(BLOCK.vertices + noise[:, None] * BLOCK.vertex_normals(), BLOCK.faces)
        found = fit_reference_points(placed(scan), RpsFit(kind="rps", points=rps_points()))  # type: ignore[arg-type]
        assert found.pose_error is not None
        moved.append((place @ found.T_design_scan[:3, :3].T + found.T_design_scan[:3, 3] - place) @ normal.T)
        errors.append(found.pose_error.at(place, normal)[0])
    assert np.mean(np.abs(np.ravel(moved)) <= 1.96 * np.array(errors)) >= 0.92
    assert np.median(errors) < 3 * np.std(moved)


@pytest.mark.parametrize("smooth_mm", [0.0, 0.7])
def test_a_best_fit_scatters_as_its_error_says(smooth_mm: float) -> None:
    """20 scans of a warped blob with a dent, noise of vertices or of neighbourhoods: how many 95 % intervals
    hold where the part lies without noise. The part's own shape is no error.
    """
    normals, weights = BLOB.vertex_normals(), BLOB.weights()
    dent = np.linalg.norm(BLOB.vertices - BLOB.vertices[50], axis=1) < 4
    shape = 0.3 * np.sin(BLOB.vertices[:, 0] / 15) - 0.4 * dent
    rows = np.concatenate([np.cross(BLOB.vertices, normals), normals], axis=1)
    fit = np.linalg.pinv(np.sqrt(weights)[:, None] * rows) * np.sqrt(weights)
    some, inside = slice(None, None, 40), []
    for seed in range(20):
        noise = noise_of_scan(BLOB, 0.1, seed, smooth_mm)
        residual = shape + noise - rows @ (fit @ (shape + noise))
        found = of_surface_fit(BLOB.vertices, normals, residual, weights, 2.4)
        assert found is not None
        of_noise = (rows @ (fit @ noise))[some]
        inside.append(np.abs(of_noise) <= 1.96 * found.at(BLOB.vertices[some], normals[some]))
    assert 0.9 <= np.mean(inside) <= 0.998


def test_a_free_motion_moves_no_deviation() -> None:
    ball = shapes.icosphere(10.0, 4)
    normals = ball.vertices / 10.0
    noise = np.random.default_rng(0).normal(0, 0.1, len(normals))
    found = of_surface_fit(ball.vertices, normals, noise, np.ones(len(normals)), 2.0)
    assert found is not None
    error = found.at(ball.vertices, normals)
    assert 0.1 * np.sqrt(3 / len(normals)) == pytest.approx(np.median(error), rel=0.3)  # three translations


def test_few_values_have_a_wider_error_so_that_its_interval_holds() -> None:
    rng = np.random.default_rng(3)
    for n in (6, 12, 40):
        found = [median_of(rng.normal(0, 1, n)) for _ in range(400)]
        inside = [abs(each.median_mm) <= 1.96 * (each.error_mm or 0) for each in found]
        assert 0.93 <= np.mean(inside) <= 0.985


def noise_of_scan(part: Mesh, sigma_mm: float, seed: int, smooth_mm: float = 0.0) -> FloatArray:
    """(n,) mm, of vertices or (`smooth_mm`) of neighbourhoods."""
    rng = np.random.default_rng(seed)
    if not smooth_mm:
        return rng.normal(0.0, sigma_mm, len(part.vertices))
    phases = part.vertices @ rng.normal(0, 1 / smooth_mm, (3, 80)) + rng.uniform(0, 2 * np.pi, 80)
    return np.asarray(sigma_mm * np.sqrt(2 / 80) * np.cos(phases).sum(axis=1))
