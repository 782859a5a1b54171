"""The whole way from two files to a decision: a printer that drifts, a burr."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

from pipeline import Acceptance, BestFit, LandmarksFit, RegistrationResult
from pipeline.core.alignment import parse_alignment
from pipeline.core.errors import PointOffSurface, UnknownRegion
from pipeline.core.mesh import Mesh
from tests.support import shapes
from tests.support.registering import register
from tests.support.scans import save
from tests.support.settings import COARSE

#: Edges of 1.5 mm cut so much off bumps with a radius of 5 mm.
CHORD_MM = 1.5**2 / 8 / 5
LIMITS = Acceptance(tolerance_mm=0.15, min_coverage=0.9, patch_mm=4.0)


@pytest.fixture(scope="module")
def design(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return save(shapes.bumpy_blob(4), tmp_path_factory.mktemp("design") / "design.stl")


def inspected(
    design: Path, print_: Mesh, folder: Path, acceptance: Acceptance = LIMITS
) -> RegistrationResult:
    scan = save(print_.moved(shapes.motion(5)), folder / "scan.ply")
    return register(design, scan, settings=COARSE, acceptance=acceptance)


def shrunk(share: float) -> Mesh:
    """A print on another triangulation, smaller by `share`: its surface of radius 20 mm by share * 20 mm."""
    part = shapes.bumpy_blob(4, triangulation=1)
    return Mesh((1 - share) * part.vertices, part.faces)


@pytest.mark.parametrize(("shrink", "decision"), [(0.002, "pass"), (0.012, "fail")])
def test_a_printer_that_drifts(design: Path, tmp_path: Path, shrink: float, decision: str) -> None:
    result = inspected(design, shrunk(shrink), tmp_path)
    assert result.verdict.status == "ok"
    assert result.inspection is not None
    assert result.inspection.decision == decision
    lowest = next(check for check in result.inspection.checks if check.kind == "lowest")
    assert lowest.value is not None
    radius = np.linalg.norm(shapes.bumpy_blob(4).vertices, axis=1)
    # The best fit keeps the centre, so the surface is off by the shrink times its radius, along its normal.
    assert -1.1 * shrink * radius.max() - CHORD_MM < lowest.value < -0.6 * shrink * radius.min()


def test_coverage_of_a_cad_file_is_of_its_faces_not_of_its_corners(tmp_path: Path) -> None:
    """The design has 12 triangles, and the scan shows none of its 8 corners."""
    size = np.array([40.0, 30.0, 20.0])
    whole = shapes.box((40.0, 30.0, 20.0), 5)
    from_middle = np.abs(whole.vertices[whole.faces].mean(axis=1) - size / 2) / size
    seen = Mesh(whole.vertices, whole.faces[(from_middle < 0.44).any(axis=1)])
    kept, numbers = np.unique(seen.faces, return_inverse=True)
    scan = Mesh(whole.vertices[kept], numbers.reshape(-1, 3))
    share = scan.face_areas_mm2().sum() / whole.face_areas_mm2().sum()
    design = save(shapes.box((40.0, 30.0, 20.0)), tmp_path / "design.stl")
    result = inspected(design, scan, tmp_path, Acceptance(tolerance_mm=1.0, min_coverage=0.9))
    assert result.inspection is not None
    coverage = next(check for check in result.inspection.checks if check.kind == "coverage")
    assert coverage.value == pytest.approx(share, abs=0.03) and share < 0.99


def test_a_burr_is_found_where_it_is(design: Path, tmp_path: Path) -> None:
    part = shapes.bumpy_blob(4, triangulation=1)
    top = int(part.vertices[:, 2].argmax())
    away = np.linalg.norm(part.vertices - part.vertices[top], axis=1)
    raised = part.vertices + np.where(away < 4.0, 0.5, 0.0)[:, None] * part.vertex_normals()
    result = inspected(design, Mesh(raised, part.faces), tmp_path)
    assert result.inspection is not None
    assert result.inspection.decision == "fail"
    first = result.inspection.extremes[0]
    assert first.value_mm == pytest.approx(0.5, abs=0.1)
    assert np.linalg.norm(np.array(first.position_mm) - part.vertices[top]) < 4.0
    highest = next(check for check in result.inspection.checks if check.kind == "highest")
    assert (highest.passed, highest.value) == (False, first.value_mm)


RIM = {"name": "rim", "region": {"kind": "segments", "segments": [999]}, "tolerance_mm": 0.1}
RIM_FIT = {"kind": "best_fit", "regions": [{"region": {"kind": "segments", "segments": [999]}}]}
#: Six points that hold every motion, the first of them far off the blob.
FAR_FIT = {
    "kind": "rps",
    "points": [
        {"name": name, "position_mm": place, "direction": direction, "radius_mm": 30}
        for name, place, direction in (
            *(("A1", [70, -5, 0], [0, 0, 1]), ("A2", [5, 5, 0], [0, 0, 1]), ("A3", [-5, 5, 0], [0, 0, 1])),
            *(("B1", [5, 0, 9], [0, 1, 0]), ("B2", [-5, 0, 9], [0, 1, 0]), ("C1", [0, 5, 9], [1, 0, 0])),
        )
    ],
}
FAR = {"name": "P1", "position_mm": [500, 0, 0], "radius_mm": 1.0, "tolerance_mm": 0.1}


@pytest.mark.parametrize(
    ("asked", "error", "message"),
    [
        ({"acceptance": {"regions": [RIM]}}, UnknownRegion, "'rim' names segment 999"),
        ({"acceptance": {"points": [FAR]}}, PointOffSurface, "inspection point 'P1' is .* mm off"),
        ({"alignment": RIM_FIT}, UnknownRegion, "'alignment.regions.0.' names segment 999"),
        ({"alignment": FAR_FIT}, PointOffSurface, "alignment point 'A1' is .* mm off"),
    ],
)
def test_a_place_that_the_design_does_not_have_is_told_before_the_search(
    asked: dict[str, Any], error: type[Exception], message: str, design: Path, tmp_path: Path
) -> None:
    """Whatever the scan is: of another part, a search would end without a pose, and need no place."""
    scan = save(shapes.torus(14.0, 5.0), tmp_path / "other.stl")
    read = {"acceptance": Acceptance.model_validate, "alignment": parse_alignment}
    given: dict[str, Any] = {key: read[key](value) for key, value in asked.items()}
    heard: list[str] = []
    with pytest.raises(error, match=message):
        register(design, scan, settings=COARSE, on_progress=lambda step: heard.append(step.stage), **given)
    assert "load" in heard and "registration" not in heard


def test_the_alignment_asked_for_is_that_of_files_deviation_and_checks(design: Path, tmp_path: Path) -> None:
    """Reference points on the sound part of a print, whose other side is swollen."""
    part = shapes.bumpy_blob(4, triangulation=1)
    swollen = part.vertices * (1 + 0.03 * np.clip(part.vertices[:, :1] / 20, 0, 1))
    scan = save(Mesh(swollen, part.faces).moved(shapes.motion(5)), tmp_path / "scan.ply")
    sound = {"kind": "box", "min_mm": [-40, -40, -40], "max_mm": [0, 40, 40]}
    alignment = BestFit.model_validate({"kind": "best_fit", "regions": [{"region": sound}]})
    given = {"settings": COARSE, "acceptance": LIMITS}
    best = register(design, scan, **given)
    result = register(design, scan, alignment=alignment, out=tmp_path / "out", **given)
    found, transform = result.alignment, result.transform
    assert best.alignment is None
    assert best.transform is not None
    assert found is not None
    assert transform is not None
    assert (found.applied, found.kind, found.reason) == (True, "best_fit", None)
    assert found.best_fit_matrix == best.transform.matrix
    assert (result.verdict, result.metrics) == (best.verdict, best.metrics)
    truth = np.linalg.inv(shapes.motion(5))
    off = [np.abs(np.array(each.matrix) - truth)[:3, 3].max() for each in (transform, best.transform)]
    assert off[0] < 0.25 * off[1]
    assert found.translation_mm > 0.02
    assert found.residual_mm is not None
    assert found.residual_mm < 0.5 * (found.best_fit_residual_mm or 0)
    aligned = trimesh.load(tmp_path / "out" / "aligned.ply", process=False)
    sent = trimesh.load(scan, process=False)
    np.testing.assert_allclose(aligned.vertices, trimesh.transform_points(sent.vertices, transform.matrix))
    assert result.deviation is not None
    assert best.deviation is not None
    assert result.deviation.max_mm > best.deviation.max_mm


def test_a_part_is_not_judged_where_its_alignment_cannot_be_made(design: Path, tmp_path: Path) -> None:
    lone = LandmarksFit.model_validate({"kind": "landmarks", "design_landmarks": [997, 998, 999]})
    scan = save(shapes.bumpy_blob(4, triangulation=1), tmp_path / "scan.ply")
    result = register(design, scan, settings=COARSE, acceptance=LIMITS, alignment=lone)
    assert result.inspection is not None
    assert result.alignment is not None
    assert (result.inspection.decision, result.alignment.applied) == ("not_judged", False)
    assert "leave a motion free" in result.inspection.reasons[0]
