"""The verdict on the report page: the words of each status, evidence, alternatives, quality of the scan."""

import json
import re
from html import unescape
from pathlib import Path
from typing import Any, get_args

import pytest

from pipeline.core.reference import Reference
from pipeline.core.results import (
    Alternative,
    Evidence,
    MadeBy,
    RegistrationResult,
    ScanQuality,
    Verdict,
    VerdictStatus,
)
from pipeline.report import tables
from pipeline.report.inspection_tables import check_tables, decision_box, extreme_tables, reference_table
from pipeline.report.page import MEANING, MOODS, _render

STATUSES: tuple[VerdictStatus, ...] = get_args(VerdictStatus)
EXAMPLE = Path(__file__).parents[3] / "openapi" / "examples" / "results.registration.json"
EVIDENCE = [
    Evidence(name="residual", of="same_part", value=-0.9, weight=-4.0, contribution=0.4, detail="RMS"),
    Evidence(name="mirror", of="same_part", value=0.0, weight=1.0, contribution=-0.0, detail="mirror image"),
    Evidence(name="matched_landmarks", of="pose", value=0.2, weight=1.0, contribution=-0.6, detail="share"),
]


def verdict(status: VerdictStatus = "ok", **fields: Any) -> Verdict:
    given = {"confidence": 0.9, "same_part": 0.95, "pose": 0.947, "findings": [], "evidence": EVIDENCE}
    return Verdict(status=status, **(given | fields))


def page(judged: Verdict) -> str:
    """The text of a page with this verdict and nothing else."""
    made_by = MadeBy(version="0", libraries={}, settings={}, seed=0)
    html = _render("t", [], [], inputs={}, made_by=made_by, subtitle="", verdict=judged)
    body = html[html.index("<body>") :]
    return " ".join(unescape(re.sub(r"<[^>]+>", " ", body)).split())


def example(**fields: Any) -> RegistrationResult:
    return RegistrationResult.model_validate(json.loads(EXAMPLE.read_text()) | fields)


@pytest.mark.parametrize("status", STATUSES)
def test_every_status_is_said_of_the_alignment_with_its_meaning(status: VerdictStatus) -> None:
    text = page(verdict(status))
    assert f"alignment: {status.replace('_', ' ')} confidence 0.90" in text
    assert MEANING[status] in text


def test_only_ok_is_good_and_without_a_pose_it_is_bad() -> None:
    assert {status for status in STATUSES if MOODS.get(status) == "good"} == {"ok"}
    assert {status for status in STATUSES if status not in MOODS} == {"mirrored", "no_match"}


def test_the_evidence_is_folded_under_the_verdict_and_says_what_speaks_for_and_against() -> None:
    text = page(verdict())
    assert "Why same part: 0.95 probability that the scan is of this design" in text
    assert "pose: 0.95 probability that the pose is right" in text
    assert "residual \N{MINUS SIGN}0.90 \N{MINUS SIGN}4.00 for +0.40 RMS" in text
    assert "matched landmarks 0.20 1.00 against \N{MINUS SIGN}0.60 share" in text
    assert "mirror 0.00 1.00 neither 0.00 mirror image" in text


def test_a_null_confidence_is_not_given_and_zero_is_not_shown() -> None:
    text = page(verdict(confidence=None, same_part=None, pose=None))
    assert "(0 to 1)" not in text
    assert "confidence not given" in text and "same part: not given" in text and "pose: not given" in text
    assert "alignment: no match confidence" not in page(verdict("no_match", confidence=0.0))


def test_results_of_earlier_versions_have_no_evidence_to_show() -> None:
    text = page(verdict(same_part=None, pose=None, evidence=[]))
    assert "Why" not in text and "same part" not in text


def test_one_row_stands_for_all_equivalent_poses() -> None:
    matrix = [[1.0, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]
    poses = [
        Alternative(matrix=matrix, score=2.0, rmse_mm=0.3, symmetry_of_design=False),
        Alternative(matrix=matrix, score=1.0, rmse_mm=0.1, symmetry_of_design=True, equivalent_poses=7),
        Alternative(matrix=matrix, score=1.0, rmse_mm=0.1, symmetry_of_design=True),
    ]
    (table,) = tables.alternatives(poses, rejected=False)
    assert [row[-1] for row in table.rows] == [
        "alternative pose",
        "symmetry of the design, stands for 7 equivalent poses",
        "symmetry of the design",
    ]
    assert tables.alternatives(poses, rejected=True)[0].rows[0][-1] == "rejected"


@pytest.mark.parametrize(("stated", "words"), [(0.05, "0.05 mm"), (None, "not stated")])
def test_the_quality_of_the_scan_is_among_the_metrics(stated: float | None, words: str) -> None:
    quality = ScanQuality(noise_mm=0.012, accuracy_mm=stated, residual_limit_mm=0.4, left_out_share=0.031)
    rows = dict(tables.registration(example(scan=quality)).rows)
    assert rows["noise of the scan (1 sigma, from local surface fits)"] == "0.012 mm"
    assert rows["stated accuracy of the scanner (1 sigma)"] == words
    assert rows["residual limit for the verdict ok"] == "0.400 mm"
    assert rows["share of the scan left out as stray pieces"] == "3.1 %"


def test_results_of_earlier_versions_have_no_quality_of_the_scan() -> None:
    rows = dict(tables.registration(example(scan=None)).rows)
    assert not [name for name in rows if "noise" in name or "stray" in name]


def test_the_decision_on_the_part_comes_first_with_its_reasons() -> None:
    result = example()
    assert result.inspection is not None
    reason = "highest: 0.300 mm is above its limit of 0.200 mm"
    failed = result.inspection.model_copy(update={"decision": "fail", "reasons": [reason]})
    made_by = MadeBy(version="0", libraries={}, settings={}, seed=0)
    html = _render(
        *("t", [], []),
        inputs={},
        made_by=made_by,
        subtitle="",
        verdict=verdict(),
        decision=decision_box(failed),
    )
    text = " ".join(unescape(re.sub(r"<[^>]+>", " ", html[html.index("<body>") :])).split())
    assert text.index("part: fail") < text.index(reason) < text.index("alignment: ok")


def test_every_check_and_every_extreme_place_has_a_row() -> None:
    inspection = example().inspection
    assert inspection is not None
    (checks,), (extremes,) = check_tables(inspection), extreme_tables(inspection)
    assert [row[0] for row in checks.rows] == [check.name for check in inspection.checks]
    assert {row[5] for row in checks.rows} <= {"passed", "failed", "not judged"}
    assert len(extremes.rows) == len(inspection.extremes)
    assert check_tables(None) == extreme_tables(None) == []


def test_the_reference_names_the_part() -> None:
    reference = Reference(serial="A-17", more={"shift": "2"})
    (table,) = reference_table(reference)
    assert table.rows == [("serial", "A-17"), ("shift", "2")]
    assert reference_table(Reference()) == reference_table(None) == []
