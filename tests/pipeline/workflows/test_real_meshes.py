"""The main job on real meshes: arches against moved, re-triangulated, noisy copies, and real depth-camera
pairs.
"""

import json
from pathlib import Path

import numpy as np
import pytest

import pipeline
from pipeline import Settings
from pipeline.kernels import rigid
from tests.accuracy.bench import printed, read, save
from tests.accuracy.teeth import score, tooth_of_vertex

pytestmark = pytest.mark.data
NIGHTLY = pytest.mark.nightly


@pytest.mark.parametrize(
    "name",
    [
        "arch_001C.ply",
        pytest.param("arch_022C.ply", marks=NIGHTLY),
        pytest.param("arch_h1.obj", marks=NIGHTLY),
    ],
)
def test_an_arch_is_found_within_one_percent_of_its_diagonal(name: str, data: Path, tmp_path: Path) -> None:
    design = read(data / "dental" / name)
    scan, truth = printed(design, seed=1)
    result = pipeline.register(data / "dental" / name, save(scan, tmp_path / "scan.ply"))
    assert result.verdict.status == "ok" and result.transform is not None
    error_mm = rigid.rms_displacement(np.array(result.transform.matrix), truth, scan.vertices)
    assert error_mm < 0.01 * design.diagonal_mm
    assert len(result.landmarks.matches) >= 10


@pytest.mark.parametrize(
    ("name", "kind"),
    [
        ("pendulum", "points"),
        ("separator", "mesh"),
        pytest.param("pendulum", "mesh", marks=NIGHTLY),
        pytest.param("separator", "points", marks=NIGHTLY),
    ],
)
def test_a_depth_camera_scan_is_found_within_five_percent(name: str, kind: str, data: Path) -> None:
    folder = data / "pairs" / name
    result = pipeline.register(folder / "cad_mm.stl", folder / f"scan_mm_{kind}.ply")
    assert result.transform is not None
    found = np.array(result.transform.matrix)
    design, scan = read(folder / "cad_mm.stl"), read(folder / f"scan_mm_{kind}.ply")
    poses = json.loads((folder / "gt.json").read_text())["T_scan_from_cad"]
    errors_mm = [
        rigid.rms_displacement(found, np.linalg.inv(np.array(pose)), scan.vertices) for pose in poses
    ]
    assert min(errors_mm) < 0.05 * design.diagonal_mm


@pytest.mark.nightly
def test_another_patients_arch_is_no_match(data: Path) -> None:
    result = pipeline.register(data / "dental" / "arch_001C.ply", data / "dental" / "arch_022C.ply")
    assert result.verdict.status == "no_match" and result.transform is None


@pytest.mark.nightly
def test_a_plate_of_eleven_parts_is_analysed(data: Path) -> None:
    """3MF with build transforms and several pieces, against itself."""
    plate = data / "cad" / "so100_mini_plate.3mf"
    few = Settings.model_validate({"resample": {"target_vertices": 1000}, "matching": {"dense_pairs": False}})
    result = pipeline.register(plate, plate, settings=few)
    assert result.verdict.status == "ok"
    assert result.segments.design.count >= 11
    assert result.metrics.rmse_mm == pytest.approx(0, abs=1e-6)


@pytest.mark.parametrize(
    "name", ["001C", "012C", *(pytest.param(name, marks=NIGHTLY) for name in ("013C", "022C"))]
)
def test_one_tooth_one_segment(name: str, data: Path) -> None:
    """Adjusted Rand index over the tooth vertices, and a centre on every tooth; K-means reaches 0.55 to
    0.66.
    """
    arch = data / "dental" / f"arch_{name}.ply"
    found = score(arch, tooth_of_vertex(arch), Settings())
    assert found.index > 0.75
    assert found.own == found.teeth
