"""How poses are compared: distance first, then what is hidden and what is left uncovered."""

import numpy as np
import pytest

from pipeline.core.mesh import IntArray, Mesh
from pipeline.core.settings import RegistrationSettings
from pipeline.core.stations import Stations
from pipeline.kernels import rigid, sampling
from pipeline.kernels.surface import Surface
from pipeline.search.pose_search import SearchResult, score_poses, search_pose
from pipeline.search.scan_model import ScanModel
from pipeline.search.schedule import REGISTRATION
from pipeline.search.types import Hypothesis, Matching, Pose
from tests.support import shapes

TIE = REGISTRATION.tie_tolerance


def pose(cost_mm2: float, occlusion_ratio: float = 0.0, coverage: float = 1.0) -> Pose:
    return Pose(np.eye(4), cost_mm2, cost_mm2**0.5, True, 1, occlusion_ratio, coverage)


def test_a_pose_that_hides_the_scan_loses_to_one_that_fits_a_little_worse() -> None:
    fits, shows = score_poses([pose(0.9, occlusion_ratio=0.3), pose(1.0)], inlier_distance_mm=2.0)
    assert shows.score_mm2 == 1.0
    assert fits.score_mm2 == pytest.approx(0.9 + (0.3 - TIE) * 4.0)


def test_a_pose_that_covers_less_of_the_design_than_another_could_loses() -> None:
    folded, spread = score_poses([pose(0.9, coverage=0.5), pose(1.0, coverage=0.9)], inlier_distance_mm=2.0)
    assert folded.score_mm2 == pytest.approx(0.9 + (0.4 - TIE) * 4.0)
    assert spread.score_mm2 == 1.0


def test_what_all_poses_share_speaks_for_none() -> None:
    """A scan of half a part with deep holes: half uncovered, a tenth hidden, wherever it lies."""
    alike = score_poses([pose(1.0, 0.1, 0.5), pose(2.0, 0.12, 0.49)], inlier_distance_mm=2.0)
    assert [each.score_mm2 for each in alike] == [1.0, 2.0]


def test_what_a_pose_leaves_of_an_offset_sphere() -> None:
    inner, outer = shapes.icosphere(10.0, 4), Surface(shapes.icosphere(11.0, 4))
    scan = ScanModel.of(inner, RegistrationSettings(), 0)
    cost = scan.fine_samples.evaluate(np.eye(4), outer, 5.0)
    assert cost.rmse_mm == pytest.approx(1.0, rel=0.01)
    assert cost.cost_mm2 == pytest.approx(1.0, rel=0.02)
    assert scan.fine_samples.evaluate(np.eye(4), outer, 0.5).cost_mm2 == pytest.approx(0.25)
    assert scan.coverage(np.eye(4), 1.0, outer, 1.2) == 1.0
    assert scan.coverage(np.eye(4), 1.0, outer, 0.5) == 0.0


def test_half_a_sphere_covers_half() -> None:
    whole = shapes.icosphere(10.0, 4)
    faces = whole.faces[(whole.vertices[whole.faces].mean(axis=1)[:, 2] > 0)]
    half = ScanModel.of(type(whole)(whole.vertices, faces), RegistrationSettings(), 0)
    assert half.coverage(np.eye(4), 1.0, Surface(whole), 0.1) == pytest.approx(0.5, abs=0.02)
    assert len(sampling.on_surface(whole, 7, 0).points) == 7


def test_the_scan_of_one_side_of_a_thin_wall_covers_that_side_only() -> None:
    """A plate of 20 x 20 x 0.4 mm, an inlier distance of 1 mm: the other side is near, and not seen."""
    plate = Surface(shapes.box((20.0, 20.0, 0.4), 4))
    top = shapes.grid_plane(21, 21).moved(
        np.array([[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0.4], [0, 0, 0, 1.0]])
    )
    scan = ScanModel.of(top, RegistrationSettings(), 0)
    side = 400.0 / float(plate.mesh.face_areas_mm2().sum())
    assert scan.coverage(np.eye(4), 1.0, plate, 1.0) == pytest.approx(side, abs=0.02)
    inward = ScanModel.of(type(top)(top.vertices, top.faces[:, ::-1]), RegistrationSettings(), 0)
    assert inward.coverage(np.eye(4), -1.0, plate, 1.0) == pytest.approx(side, abs=0.02)


OUTER_MM, CAVITY_MM = 40.0, 20.0
#: A motion of the corner at +20, +20, +20 of the box onto that at -10, -10, -10 of its cavity: three planes
#: that meet look the same from both sides.
INTO_CAVITY = rigid.compose(
    -np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]), np.full(3, OUTER_MM / 2 - CAVITY_MM / 2)
)


def hollow_box() -> Surface:
    outer, inner = (shapes.box((side, side, side), 4) for side in (OUTER_MM, CAVITY_MM))
    vertices = [
        mesh.vertices - (mesh.vertices.max(axis=0) + mesh.vertices.min(axis=0)) / 2 for mesh in (outer, inner)
    ]
    return Surface(
        Mesh(
            np.concatenate(vertices),
            np.concatenate([outer.faces, inner.faces[:, ::-1] + len(outer.vertices)]),
        )
    )


def corner_of_box(stations: np.ndarray) -> tuple[Mesh, Stations]:
    """Points of the three faces at the corner +20, +20, +20, each measured by the first station."""
    across, along = np.meshgrid(np.linspace(6.0, 20.0, 30), np.linspace(6.0, 20.0, 30))
    faces = [
        np.insert(np.stack([across.ravel(), along.ravel()], axis=1), axis, 20.0, axis=1) for axis in range(3)
    ]
    points = np.concatenate(faces)
    of_vertex: IntArray = np.zeros(len(points), dtype=np.int32)
    return Mesh(points), Stations.of_points(points, stations, of_vertex)


def searched(scan: Mesh, stations: Stations | None) -> SearchResult:
    """From both poses, that in the cavity first, as nothing but the view tells them apart."""
    hypotheses = tuple(Hypothesis(T, 1.0, 0.0, "dense") for T in (INTO_CAVITY, np.eye(4)))
    none = np.zeros(0, dtype=np.int64)
    matching = Matching(hypotheses, None, none, none)
    model = ScanModel.of(scan, RegistrationSettings(), 0, stations)
    return search_pose(model, hollow_box(), matching, RegistrationSettings())


def test_where_the_scanner_stood_tells_a_corner_outside_from_one_in_a_cavity() -> None:
    scan, stations = corner_of_box(np.array([[120.0, 90.0, 100.0]]))
    guessed, known = searched(scan, None), searched(scan, stations)
    np.testing.assert_allclose(guessed.best.T_design_scan, INTO_CAVITY, atol=1e-6)
    np.testing.assert_allclose(known.best.T_design_scan, np.eye(4), atol=1e-6)
    assert known.best.occlusion_ratio == 0.0 and not known.ignored_stations
    (other,) = known.alternatives
    assert other.occlusion_ratio == 1.0


def test_stations_that_every_pose_contradicts_are_ignored() -> None:
    """Scans that were merged say that they were taken from one place: here below the part."""
    scan, stations = corner_of_box(np.array([[0.0, 0.0, -100.0]]))
    found = searched(scan, stations)
    assert found.ignored_stations
    np.testing.assert_allclose(found.best.T_design_scan, INTO_CAVITY, atol=1e-6)  # as without them


def test_a_station_in_the_box_of_its_own_points_is_none() -> None:
    scan, stations = corner_of_box(np.array([[12.0, 12.0, 12.0]]))
    assert not stations.any
    assert ScanModel.of(scan, RegistrationSettings(), 0, stations).lines_of_sight is None


def test_the_stations_of_a_mirror_image_are_mirrored() -> None:
    scan, stations = corner_of_box(np.array([[120.0, 90.0, 100.0]]))
    sight = ScanModel.mirrored(scan, None, RegistrationSettings(), 0, stations).lines_of_sight
    assert sight is not None
    np.testing.assert_allclose(sight.scanner, np.broadcast_to([-120.0, 90.0, 100.0], sight.points.shape))
    assert (sight.points[:, 0] < 0).all()
