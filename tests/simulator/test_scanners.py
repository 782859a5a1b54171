"""The simulated scanners do what their docstrings say: seen from the camera, off by the accuracy, closed."""

import importlib
from collections.abc import Callable
from functools import lru_cache

import numpy as np
import pytest

from pipeline.core.mesh import BoolArray, FloatArray, Mesh
from pipeline.kernels import rigid, topology
from pipeline.kernels.surface import Surface
from tests.support import scanners, shapes
from tests.support.scanners import SURROUNDINGS, Camera, SimulatedScan
from tests.support.scanners.surroundings import TOUCHING

PART = shapes.bumpy_blob(4)
Scanner = Callable[[np.random.Generator], SimulatedScan]
CAMERA = importlib.import_module("tests.support.scanners.depth_camera")  # the package has the function
PLANE = shapes.grid_plane(60, 60, step_mm=1.0)


def distances_mm(scan: SimulatedScan, part: Mesh = PART) -> FloatArray:
    return Surface(part).closest(rigid.transformed(scan.T_design_scan, scan.mesh.vertices)).distance


def rng() -> np.random.Generator:
    return np.random.default_rng(4)


@lru_cache(maxsize=1)
def light_scan() -> SimulatedScan:
    return scanners.structured_light(PART, 0.02, rng())


def camera_at(
    monkeypatch: pytest.MonkeyPatch, part: Mesh, direction: list[float], stand_off: float = 4.0
) -> FloatArray:
    """(3,) mm, design frame: where the camera stands from now on, `stand_off` diagonals off."""
    unit = np.array(direction) / np.linalg.norm(direction)
    monkeypatch.setattr(CAMERA, "random_direction", lambda rng: unit)
    monkeypatch.setattr(CAMERA, "STAND_OFF", stand_off)
    centre = (part.vertices.min(axis=0) + part.vertices.max(axis=0)) / 2
    return np.asarray(centre + stand_off * part.diagonal_mm * unit)


def blocked(eye: FloatArray, points: FloatArray, part: Mesh) -> BoolArray:
    """(k,) whether a triangle cuts the segment from the eye to each point before 0.999 of it: every triangle
    against every segment (Moeller & Trumbore, 1997), without a tree.
    """
    a, b, c = (part.vertices[part.faces[:, k]] for k in range(3))
    found = np.zeros(len(points), dtype=np.bool_)
    for number, way in enumerate(points - eye):
        h = np.cross(way, c - a)
        with np.errstate(divide="ignore", invalid="ignore"):
            over = 1.0 / np.einsum("md,md->m", b - a, h)
            u = over * ((eye - a) * h).sum(axis=1)
            q = np.cross(eye - a, b - a)
            v, t = over * (q @ way), over * np.einsum("md,md->m", c - a, q)
            found[number] = ((u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0) & (t < 0.999)).any()
    return found


def along_view_mm(scan: SimulatedScan, eye: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Of a scan of the plane z = 0: points (k, 3) mm in its frame, range (k,) of the plane along each line of
    sight, and by how much the point lies beyond it.
    """
    points = rigid.transformed(scan.T_design_scan, scan.mesh.vertices)
    way = points - eye
    measured = np.linalg.norm(way, axis=1)
    true = measured * -eye[2] / way[:, 2]
    return points, true, measured - true


def test_a_perfect_camera_sees_points_of_the_part_and_all_from_one_side() -> None:
    scan = scanners.depth_camera(PART, Camera(0.0), rng())
    assert distances_mm(scan).max() < 1e-4  # single precision of the ray cast
    normals = scan.mesh.face_cross_mm2()
    one_side = normals.sum(axis=0) / np.linalg.norm(normals.sum(axis=0))
    assert ((normals @ one_side) > 0).mean() > 0.97
    assert 2_000 < len(scan.mesh.vertices) < 20_000


def test_a_camera_is_off_by_its_accuracy_along_the_view() -> None:
    plane = shapes.grid_plane(60, 60, step_mm=1.0)
    off = []
    for seed in range(6):
        try:
            scan = scanners.depth_camera(plane, Camera(0.2), np.random.default_rng(seed))
        except ValueError:
            continue
        normal = np.array([0.0, 0.0, 1.0])
        placed = rigid.transformed(scan.T_design_scan, scan.mesh.vertices)
        if len(placed) > 3000:  # not a view along the plane
            off.append(float(np.sqrt(((placed @ normal) ** 2).mean())))
    assert 0.05 < np.median(off) < 0.3


def test_points_only_have_no_triangles() -> None:
    scan = scanners.depth_camera(PART, Camera(0.1, as_points=True), rng())
    assert scan.mesh.is_cloud and len(scan.is_part) == len(scan.mesh.vertices)


def test_structured_light_is_as_accurate_as_stated() -> None:
    scan = scanners.structured_light(PART, 0.05, rng())
    rms_mm = float(np.sqrt((distances_mm(scan) ** 2).mean()))
    assert 0.5 * 0.05 < rms_mm < 1.2 * 0.05


@pytest.mark.nightly
def test_a_dental_scan_has_holes_where_nothing_is_seen_from_above() -> None:
    tube = shapes.torus(10.0, 3.0, 96, 48)
    scan = scanners.dental_scanner(tube, 0.02, rng())
    area = scan.mesh.face_areas_mm2().sum() / tube.face_areas_mm2().sum()
    assert 0.5 < area < 0.9
    normals = scan.mesh.face_cross_mm2() @ scan.T_design_scan[:3, :3].T
    upward = normals[:, 2] / np.linalg.norm(normals, axis=1) * np.sign(normals[:, 2].sum())
    # a view tilted by 40 degrees sees normals up to 130 degrees from above
    assert upward.min() > np.cos(np.radians(130)) - 0.1
    assert np.sqrt((distances_mm(scan, tube) ** 2).mean()) < 2 * 0.02 + 0.01


@pytest.mark.nightly
def test_ct_is_closed_and_within_a_voxel() -> None:
    scan = scanners.ct(PART, 0.4, rng())
    assert (topology.edges(scan.mesh.faces).count == 2).all()
    assert distances_mm(scan).max() < 0.4 * np.sqrt(3)
    assert distances_mm(scan).std() > 0.02  # in steps


@pytest.mark.parametrize("kind", sorted(SURROUNDINGS))
def test_what_lies_around_is_marked_and_apart(kind: str) -> None:
    scan = light_scan()
    added = scanners.with_surroundings(scan, kind, rng())
    assert (~added.is_part).any()
    np.testing.assert_array_equal(added.mesh.vertices[added.is_part], scan.mesh.vertices)
    assert distances_mm(added)[added.is_part].max() < 0.3
    assert distances_mm(added)[~added.is_part].min() > 0.3


def test_the_same_seed_gives_the_same_bytes_and_another_does_not(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(importlib.import_module("tests.support.scanners.structured_light"), "VERTICES", 2_000)
    made: tuple[Scanner, ...] = (
        lambda rng: scanners.depth_camera(PART, Camera(0.1), rng),
        lambda rng: scanners.structured_light(PART, 0.05, rng),
    )
    for scanner in made:
        one, again, other = (scanner(np.random.default_rng(seed)) for seed in (1, 1, 2))
        assert one.mesh.vertices.tobytes() == again.mesh.vertices.tobytes()
        assert one.mesh.vertices.tobytes() != other.mesh.vertices.tobytes()


@pytest.mark.parametrize("part", [PART, shapes.torus(10.0, 4.0, 64, 32)], ids=["blob", "torus"])
def test_nothing_lies_between_the_camera_and_its_points(monkeypatch: pytest.MonkeyPatch, part: Mesh) -> None:
    eye = camera_at(monkeypatch, part, [1.0, 0.3, 0.4])
    scan = scanners.depth_camera(part, Camera(0.0), rng())
    points = rigid.transformed(scan.T_design_scan, scan.mesh.vertices)
    back = (eye - points) / np.linalg.norm(eye - points, axis=1, keepdims=True)
    clearance_mm = 1e-3 * np.linalg.norm(eye - points, axis=1, keepdims=True)
    assert not Surface(part).intersects_rays(points + clearance_mm * back, back).any()
    assert not blocked(eye, points[:: len(points) // 200], part).any()
    cosine = ((eye - part.vertices) * part.vertex_normals()).sum(axis=1)
    cosine /= np.linalg.norm(eye - part.vertices, axis=1)
    behind = part.vertices[cosine < -0.3]  # clear of the silhouette
    assert blocked(eye, behind[:: len(behind) // 50], part).all()  # the test itself can tell


@pytest.mark.parametrize("seed", range(4))
def test_on_a_plane_seen_from_the_front_a_camera_is_off_by_its_accuracy(
    monkeypatch: pytest.MonkeyPatch, seed: int
) -> None:
    eye = camera_at(monkeypatch, PLANE, [0.0, 0.0, 1.0])
    scan = scanners.depth_camera(PLANE, Camera(0.2), np.random.default_rng(seed))
    off_mm = along_view_mm(scan, eye)[2]
    assert np.sqrt((off_mm**2).mean()) == pytest.approx(0.2, rel=0.1)


def test_range_noise_grows_with_the_square_of_the_range_over_the_cosine(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Distortion is a cubic of the image: what is left after the best cubic is the noise."""
    eye = camera_at(monkeypatch, PLANE, [1.0, 0.0, 1.0], stand_off=1.5)
    measured, stated = [], []
    for seed in range(12):
        scan = scanners.depth_camera(PLANE, Camera(0.1), np.random.default_rng(seed))
        points, true, off_mm = along_view_mm(scan, eye)
        forward = PLANE.vertices.mean(axis=0) - eye
        image = (points - eye) / ((points - eye) @ forward)[:, None] * float(forward @ forward)
        x, y = image[:, 1] / 30, (image @ np.cross(forward, [0.0, 1.0, 0.0])) / 30 / np.linalg.norm(forward)
        cubic = np.stack([x**i * y**j for i in range(4) for j in range(4 - i)], axis=1)
        noise_mm = off_mm - cubic @ np.linalg.lstsq(cubic, off_mm, rcond=None)[0]
        growth = true**2 / (eye[2] / true)  # the plane is z = 0: its cosine of incidence is height over range
        far = true > np.median(true)
        measured.append(np.log(noise_mm[far].std() / noise_mm[~far].std()))
        stated.append(np.log(np.sqrt((growth[far] ** 2).mean() / (growth[~far] ** 2).mean())))
    assert np.exp(np.mean(stated)) > 1.5
    assert np.exp(np.mean(measured)) == pytest.approx(np.exp(np.mean(stated)), rel=0.1)


def test_the_part_stands_on_a_touching_table() -> None:
    assert not set(TOUCHING) & set(SURROUNDINGS)
    scan = light_scan()
    added = scanners.with_surroundings(scan, "touching table", rng())
    np.testing.assert_array_equal(added.mesh.vertices[added.is_part], scan.mesh.vertices)
    patch = added.mesh.vertices[~added.is_part]
    normal = np.linalg.svd(patch - patch.mean(axis=0), full_matrices=False)[2][2]
    height_mm = (scan.mesh.vertices - patch.mean(axis=0)) @ normal
    height_mm *= np.sign(height_mm.sum())
    assert abs(height_mm.min()) < 1e-9


@pytest.mark.nightly
def test_the_other_scanners_too_give_the_same_bytes_again(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(importlib.import_module("tests.support.scanners.dental"), "VERTICES", 2_000)
    made: tuple[Scanner, ...] = (
        lambda rng: scanners.dental_scanner(PART, 0.05, rng),
        lambda rng: scanners.ct(PART, 2.0, rng),
        lambda rng: scanners.with_surroundings(light_scan(), "specks", rng),
    )
    for scanner in made:
        one, again, other = (scanner(np.random.default_rng(seed)).mesh for seed in (1, 1, 2))
        assert one.vertices.tobytes() == again.vertices.tobytes()
        assert one.faces.tobytes() == again.faces.tobytes()
        assert one.vertices.tobytes() != other.vertices.tobytes()
