"""How poses are compared: distance first, then what is hidden and what is left uncovered."""

import numpy as np
import pytest

from pipeline.core.settings import RegistrationSettings
from pipeline.kernels import sampling
from pipeline.kernels.surface import Surface
from pipeline.search.pose_search import score_poses
from pipeline.search.scan_model import ScanModel
from pipeline.search.schedule import REGISTRATION
from pipeline.search.types import Pose
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
