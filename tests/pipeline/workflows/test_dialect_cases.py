"""Files of dialects that were read wrongly or refused before: each ends `ok`, at the pose that is known."""

import json
from pathlib import Path

import numpy as np
import pytest

import pipeline
from pipeline import MeshFile, Settings
from pipeline.core.settings import LoadSettings
from pipeline.kernels import rigid
from pipeline.stages.load import load

pytestmark = pytest.mark.data
NIGHTLY = pytest.mark.nightly
#: Distance from the known pose, over the points of the scan. Chosen by hand: noise of the scans is 0.03 mm.
NEAR_MM = 0.05
DESIGNS = ("d_corner.stl", "t_bambu_two_objects.3mf", "t_support_object.3mf", "p_mixed_quads.ply")
DESIGNS += ("o_negative_interleaved.obj", "s_trailing2.stl", "g_quant_norm.glb")
SCANS = (
    "x_decimal_comma_semicolon.txt",
    "x_id_header.csv",
    "r_specks.ply",
    "r_table.ply",
    "r_far_double.ply",
)


def check(folder: Path, design: str, scan: str, truth: list[list[float]]) -> None:
    result = pipeline.register(
        folder / design, folder / scan, settings=Settings.model_validate({"report": {"content": "none"}})
    )
    assert result.verdict.status == "ok" and result.transform is not None
    points = load(MeshFile(folder / scan), "scan", LoadSettings(), needs_surface=False).mesh.vertices
    error_mm = rigid.rms_displacement(np.array(result.transform.matrix), np.array(truth), points)
    assert error_mm < NEAR_MM


@pytest.mark.parametrize(
    "name", ["d_blocks.stl", *(pytest.param(name, marks=NIGHTLY) for name in DESIGNS + SCANS)]
)
def test_a_dialect_ends_ok_at_the_known_pose(name: str, data: Path) -> None:
    folder = data / "cases"
    cases = json.loads((folder / "cases.json").read_text())
    (case,) = [each for each in cases if name in (each["design"], each["scan"])]
    check(folder, case["design"], case["scan"], case["T_design_scan"])


@pytest.mark.nightly
def test_a_design_of_strips_that_is_the_scan_itself_does_not_move(data: Path) -> None:
    """The list of cases gives it the pose of the other cases, but its points are those of the scan."""
    check(data / "cases", "p_tristrips.ply", "bracket_scan.ply", np.eye(4).tolist())
