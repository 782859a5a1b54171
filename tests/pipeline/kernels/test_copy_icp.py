"""The fast ICP against the plain algorithm, against Open3D, and where the answer is known."""

import numpy as np
import open3d as o3d
import pytest
from scipy.spatial import cKDTree

from pipeline.core.mesh import FloatArray
from pipeline.kernels import copy_icp, rigid
from pipeline.kernels.copy_icp import CopyIcp
from tests.support import shapes

LIBRARY, CONVERGED = range(2)


def centred(points: FloatArray) -> FloatArray:
    return points - points.mean(axis=0)


def motions(count: int, turn_deg: float, shift_mm: float, seed: int = 0) -> FloatArray:
    """(count, 4, 4), each of at most so much."""
    rng = np.random.default_rng(seed)
    axis = rng.normal(size=(count, 3))
    axis /= np.linalg.norm(axis, axis=1)[:, None]
    turn = np.radians(turn_deg) * rng.random((count, 1)) * axis
    return rigid.from_vector(np.concatenate([turn, rng.uniform(-shift_mm, shift_mm, (count, 3))], axis=1))


def plain(points: FloatArray, T_copy_points: FloatArray) -> tuple[list[FloatArray], list[float]]:
    """Every motion of plain ICP until no pair changes, and the RMS distance of the pairs at the start and
    under each.
    """
    copy = rigid.transformed(T_copy_points, points)
    tree = cKDTree(points)
    distance, pairs = tree.query(copy)
    found, rms = [], [float(np.sqrt(np.mean(distance**2)))]
    while True:
        found.append(rigid.fit(copy, points[pairs]))
        before = pairs
        distance, pairs = tree.query(rigid.transformed(found[-1], copy))
        rms.append(float(np.sqrt(np.mean(distance**2))))
        if (pairs == before).all():
            return found, rms


CLOUDS = {
    "blob": centred(shapes.bumpy_blob(3).vertices),
    "few points": centred(shapes.bumpy_blob(3).vertices[::15]),
    "scattered": np.random.default_rng(3).normal(0.0, 9.0, (400, 3)),
    "flat": centred(
        shapes.grid_plane(20, 15).vertices + np.random.default_rng(4).normal(0, 0.2, (300, 3)) * [1, 1, 0]
    ),
}


@pytest.mark.parametrize("name", CLOUDS)
@pytest.mark.parametrize(("turn_deg", "shift_mm"), [(0.0, 2.5), (40.0, 4.0), (180.0, 4.0)])
def test_it_takes_the_very_steps_of_plain_icp(name: str, turn_deg: float, shift_mm: float) -> None:
    points = CLOUDS[name]
    T = motions(8, turn_deg, shift_mm)
    found = CopyIcp(points).align(T)
    for trial in range(len(T)):
        steps, rms = plain(points, T[trial])
        assert found.converged[trial]
        assert found.iterations[trial, CONVERGED] == len(steps)
        np.testing.assert_allclose(found.T_points_copy[trial, CONVERGED], steps[-1], atol=1e-9)
        assert np.linalg.det(found.T_points_copy[trial, CONVERGED]) == pytest.approx(1.0, abs=1e-13)
        still = np.flatnonzero(np.abs(np.diff(rms)) < copy_icp.LIBRARY_TOLERANCE)
        end = min(int(still[0]) + 1 if len(still) else len(steps), copy_icp.LIBRARY_ITERATIONS)
        assert found.iterations[trial, LIBRARY] == end
        np.testing.assert_allclose(found.T_points_copy[trial, LIBRARY], steps[end - 1], atol=1e-9)


@pytest.mark.parametrize(("turn_deg", "shift_mm"), [(0.0, 2.5), (60.0, 5.0)])
def test_the_library_rule_is_open3d_with_its_defaults(turn_deg: float, shift_mm: float) -> None:
    points = CLOUDS["blob"]
    target = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points))
    T = motions(6, turn_deg, shift_mm, seed=1)
    found = CopyIcp(points).align(T)
    for trial in range(len(T)):
        copy = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(rigid.transformed(T[trial], points)))
        theirs = o3d.pipelines.registration.registration_icp(copy, target, 1e6, np.eye(4))
        np.testing.assert_allclose(found.T_points_copy[trial, LIBRARY], theirs.transformation, atol=1e-9)
    if turn_deg > 0:
        assert (found.iterations[:, LIBRARY] == copy_icp.LIBRARY_ITERATIONS).any(), "the cap was not tried"


def test_a_shift_below_half_the_spacing_is_undone_in_one_step() -> None:
    points = CLOUDS["scattered"]
    spacing = cKDTree(points).query(points, k=2)[0][:, 1].min()
    T = motions(20, 0.0, 0.49 * spacing / np.sqrt(3))
    icp = CopyIcp(points)
    found = icp.align(T)
    assert found.converged.all()
    assert (found.iterations == 1).all()
    np.testing.assert_allclose(found.T_points_copy, np.stack([rigid.inverse(T)] * 2, axis=1), atol=1e-13)
    for rule in (LIBRARY, CONVERGED):
        assert icp.rmse_mm(T, found.T_points_copy[:, rule]).max() < 1e-12


def test_of_equally_near_points_the_first_is_taken() -> None:
    points = np.array([[0.0, 0, 0], [4, 0, 0], [0, 6, 0], [0, 0, 9]])
    T = np.eye(4)[None].copy()
    T[0, 0, 3] = 2.0  # the first point lands in the middle between the first two
    found = CopyIcp(points).align(T)
    np.testing.assert_allclose(found.T_points_copy[0, CONVERGED], rigid.inverse(T[0]), atol=1e-15)
    assert found.iterations[0, CONVERGED] == 1
    assert CopyIcp(points[[1, 0, 2, 3]]).align(T).iterations[0, CONVERGED] > 1


def test_points_in_one_place_are_no_trouble() -> None:
    points = np.concatenate([CLOUDS["scattered"]] * 2)
    found = CopyIcp(points).align(motions(3, 5.0, 0.5))
    for trial, T in enumerate(motions(3, 5.0, 0.5)):
        np.testing.assert_allclose(found.T_points_copy[trial, CONVERGED], rigid.inverse(T), atol=1e-12)


def test_the_error_is_that_of_known_partners() -> None:
    points = CLOUDS["few points"]
    T, back = motions(5, 30.0, 5.0), motions(5, 30.0, 5.0, seed=2)
    expected = [rigid.rms_displacement(b @ t, np.eye(4), points) for t, b in zip(T, back, strict=True)]
    np.testing.assert_allclose(CopyIcp(points).rmse_mm(T, back), expected, rtol=1e-12)


def test_one_thread_and_many_give_the_same_bits() -> None:
    points, T = CLOUDS["blob"], motions(40, 30.0, 5.0)
    one, many = (CopyIcp(points, threads=threads).align(T) for threads in (1, 5))
    np.testing.assert_array_equal(one.T_points_copy, many.T_points_copy)
    np.testing.assert_array_equal(one.iterations, many.iterations)


def test_answering_false_stops_it() -> None:
    with pytest.raises(InterruptedError):
        CopyIcp(CLOUDS["blob"]).align(motions(3000, 30.0, 5.0), lambda _: False)
