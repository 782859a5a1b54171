"""Faces of a STEP from the file to the results: a tower on a block, whose top is printed too high."""

import csv
from pathlib import Path

import numpy as np
import pytest
import trimesh

import pipeline
from pipeline import Acceptance
from pipeline.core.errors import UnknownRegion
from pipeline.core.mesh import Mesh
from pipeline.core.mesh_file import MeshFile
from pipeline.core.settings import LoadSettings
from pipeline.stages.load import load
from tests.support import shapes
from tests.support.registering import register
from tests.support.scans import save
from tests.support.settings import COARSE
from tests.support.step_files import Step

BLOCK, TOWER, FOOT = np.array([30.0, 20.0, 10.0]), np.array([8.0, 6.0, 12.0]), np.array([2.0, 3.0, 10.0])
TOO_HIGH_MM = 0.4
#: Of the tower: its faces follow the six of the block.
TOWER_FOOT, TOWER_TOP = 6, 7


@pytest.fixture(scope="module")
def design(tmp_path_factory: pytest.TempPathFactory) -> Path:
    step = Step()
    block, tower = step.box_faces(BLOCK), step.box_faces(TOWER, FOOT)
    step.product("part", [step.solid(block, "block"), step.solid(tower, "tower")])
    path = tmp_path_factory.mktemp("design") / "design.step"
    path.write_bytes(step.text())
    return path


@pytest.fixture(scope="module")
def scan(design: Path) -> Path:
    mesh = load(MeshFile.of(design), "design", LoadSettings(), needs_surface=True).mesh
    vertices, faces = trimesh.remesh.subdivide_to_size(mesh.vertices, mesh.faces, 1.5)
    is_top = vertices[:, 2] > (FOOT + TOWER)[2] - 1e-6
    vertices[is_top, 2] += TOO_HIGH_MM
    return save(Mesh(vertices, faces).moved(shapes.motion(3)), design.with_name("scan.ply"))


def limits(*faces: str | int) -> Acceptance:
    region = {"name": "top", "region": {"kind": "brep_faces", "faces": list(faces)}, "tolerance_mm": 0.2}
    return Acceptance.model_validate({"regions": [region]})


def test_segments_and_a_table_name_the_faces(design: Path, tmp_path: Path) -> None:
    result = pipeline.find_landmarks(design, settings=COARSE, out=tmp_path)
    listed = [number for centre in result.segments.mesh.centres for number in centre.brep_faces or []]
    assert sorted(listed) == [number for number in range(12) if number != TOWER_FOOT]  # it lies inside
    with (tmp_path / "mesh.brep_faces.csv").open(encoding="utf-8") as stream:
        rows = list(csv.DictReader(stream))
    assert [row["body"] for row in rows] == ["block"] * 6 + ["tower"] * 6
    assert {row["kind"] for row in rows} == {"plane"}
    foot, top = rows[TOWER_FOOT], rows[TOWER_TOP]
    assert (foot["segment"], foot["area_mm2"]) == ("", "0.0")
    assert float(top["area_mm2"]) == pytest.approx(8.0 * 6.0, rel=1e-5)
    assert [float(top[axis]) for axis in ("x_mm", "y_mm", "z_mm")] == pytest.approx([6, 6, 22], rel=1e-5)
    assert float(rows[1]["area_mm2"]) == pytest.approx(30.0 * 20.0 - 8.0 * 6.0, rel=1e-5)  # below the tower


def test_a_face_has_limits_by_number_or_name(design: Path, scan: Path) -> None:
    result = register(design, scan, settings=COARSE, acceptance=limits(TOWER_TOP))
    assert result.inspection is not None
    checks = [check for check in result.inspection.checks if check.region == "top"]
    highest = next(check for check in checks if check.kind == "highest")
    assert highest.value == pytest.approx(TOO_HIGH_MM, abs=0.1)
    assert highest.passed is False
    # both solids call a face so: the top of the block beside that of the tower
    named = register(design, scan, settings=COARSE, acceptance=limits("side 1"))
    assert named.inspection is not None
    of = {check.kind: check.value for check in named.inspection.checks if check.region == "top"}
    assert of["lowest"] is not None and of["highest"] is not None
    assert of["lowest"] < 0.1 < 0.3 < of["highest"]
    with pytest.raises(UnknownRegion, match="'bore'"):
        register(design, scan, settings=COARSE, acceptance=limits("bore"))


def test_a_design_of_triangles_has_no_faces_to_name(scan: Path) -> None:
    with pytest.raises(UnknownRegion, match="send the design as STEP"):
        register(scan, scan, settings=COARSE, acceptance=limits(0))
