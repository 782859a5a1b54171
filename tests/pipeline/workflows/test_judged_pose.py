"""One side of a part whose first search had no right hypothesis is found by the second, and no more is."""

from dataclasses import replace

import numpy as np
import pytest

from pipeline.analysis.mesh_analysis import analyse_mesh
from pipeline.analysis.scan_registration import match_scan
from pipeline.core.job_parameters import JobParameters
from pipeline.core.mesh import Mesh
from pipeline.core.timing import silent
from pipeline.kernels import rigid
from pipeline.workflows import judged_pose as workflow
from tests.support import shapes
from tests.support.designs import design_of, input_of
from tests.support.settings import COARSE

DESIGN = shapes.bumpy_blob(4)
AWAY = shapes.motion(6)
#: Out of reach of every ICP.
FAR = np.eye(4)
FAR[0, 3] = 1000.0
#: Without a look at the mirror image, whose search may find the pose in passing.
SETTINGS = COARSE.model_copy(
    update={"registration": COARSE.registration.model_copy(update={"mirror_share": 0.5})}
)
JOB = JobParameters.of(SETTINGS, 0, None, None)


def one_side(part: Mesh, share: float) -> Mesh:
    """The triangles that lie farthest along x and hold `share` of the area."""
    outward = np.argsort(-part.vertices[part.faces].mean(axis=1)[:, 0], kind="stable")
    area = np.cumsum(part.face_areas_mm2()[outward])
    kept = part.faces[np.sort(outward[: np.searchsorted(area, share * area[-1])])]
    used, numbers = np.unique(kept, return_inverse=True)
    return Mesh(part.vertices[used], numbers.reshape(-1, 3))


ONE_SIDE = one_side(shapes.bumpy_blob(4, triangulation=7), 0.3).moved(AWAY)


def found_after_a_wrong_search(scan: Mesh) -> workflow.JudgedPose:
    """The only hypothesis of the first search is a pose that the scan does not have."""
    design, source = design_of(DESIGN, SETTINGS), input_of(scan, "scan")
    analysed = analyse_mesh(scan, "scan", design.scales, SETTINGS, silent(), 0)
    matched = match_scan(analysed, design, JOB)
    wrong = replace(matched.matching.hypotheses[0], T_design_scan=FAR, source="axes")
    lost = replace(matched.matching, hypotheses=(wrong,), T_landmarks=None)
    return workflow.judged_pose(replace(matched, matching=lost), source, design, JOB)


def test_one_side_is_found_by_the_second_search() -> None:
    found = found_after_a_wrong_search(ONE_SIDE)
    assert found.verdict.status == "ok"
    T_design_scan = found.registered.registration.fit.T_design_scan
    assert rigid.rms_displacement(T_design_scan, rigid.inverse(AWAY), ONE_SIDE.vertices) < 0.05


def test_another_part_still_is_not() -> None:
    other = one_side(shapes.torus(14.0, 5.0), 0.3).moved(AWAY)
    assert found_after_a_wrong_search(other).verdict.status == "no_match"


def test_a_scan_of_more_is_not_searched_again(monkeypatch: pytest.MonkeyPatch) -> None:
    """Here more is what shows more than a quarter; all larger scans are found by the first search."""
    monkeypatch.setattr(workflow, "SECOND_SEARCH", replace(workflow.SECOND_SEARCH, max_area_share=0.25))
    assert found_after_a_wrong_search(ONE_SIDE).verdict.status == "no_match"
