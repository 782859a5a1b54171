"""The verdict on the report page: the words of each status, evidence, alternatives, quality of the scan."""

import json
import re
from html import unescape
from pathlib import Path
from typing import Any, get_args

import pytest

from pipeline.core.reference import Reference
from pipeline.core.report_header import ReportHeader
from pipeline.core.results import (
    Alternative,
    Evidence,
    Finding,
    MadeBy,
    RegistrationResult,
    ScanQuality,
    Verdict,
    VerdictStatus,
)
from pipeline.report import tables
from pipeline.report.inspection_tables import check_tables, decision_box, extreme_tables, identity
from pipeline.report.page import MEANING, MOODS, _render, registration
from pipeline.report.registration_pictures import PageViews
from pipeline.report.sections import Pictures
from pipeline.report.words import Words

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
    assert "same part: 0.95 probability that the scan is of this design" in text
    assert "pose: 0.95 probability that the pose is right" in text
    assert "residual \N{MINUS SIGN}0.90 \N{MINUS SIGN}4.00 for +0.40 RMS" in text
    assert "matched landmarks 0.20 1.00 against \N{MINUS SIGN}0.60 share" in text
    assert "mirror 0.00 1.00 neutral 0.00 mirror image" in text


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
    line, table = tables.alternatives(poses, rejected=False)
    assert isinstance(line, tables.Line) and line.text.startswith("8 besides this one, by symmetry")
    assert isinstance(table, tables.Table) and table.title == "Alternative poses" and len(table.rows) == 1
    assert tables.alternatives(poses[1:], rejected=False) == [line]
    assert tables.alternatives(poses[:1], rejected=True)[0].title == "Rejected poses"


def test_a_symmetric_design_has_no_other_pose_and_equivalent_ones_are_as_right() -> None:
    finding = Finding(code="symmetric_design", detail="7 other poses", value=7.0)
    text = page(verdict(findings=[finding]))
    assert "each is correct" in text and MEANING["ok"] not in text


def test_without_a_pose_the_reason_is_not_buried_under_what_is_said_of_the_rejected_one() -> None:
    reason = Finding(code="low_fitness", detail="12% of the scan lies on it", value=0.12)
    about = Finding(code="free_motion", detail="the rotation is uncertain", value=1.0)
    text = page(verdict("no_match", confidence=0.0, findings=[about, reason]))
    assert text.index("low_fitness") < text.index("About the best rejected pose") < text.index("free_motion")
    text = page(verdict("under_constrained", findings=[about, reason]))
    assert "rejected pose" not in text and text.index("free_motion") < text.index("low_fitness")


def test_no_two_numbers_have_the_same_words() -> None:
    result = example()
    assert result.deviation is not None
    both = tables.both_ways(result.deviation, result.deviation_of_design)
    names = [row[0] for row in (*both.rows, *tables.registration(result).rows)]
    assert len(set(names)) == len(names) and not [name for name in names if names.count(name) > 1]


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


def test_a_summary_has_the_first_page_only(tmp_path: Path) -> None:
    (tmp_path / "deviation_histogram.svg").write_text("<svg/>")
    views = PageViews(Pictures("Views", "", []), None, Pictures("Segments", "", []), "")
    whole, first = (
        registration(example(), views, tmp_path, words=Words("en"), summary=summary)
        for summary in (False, True)
    )
    for words in ("alignment: ok", "Histogram of the deviation"):
        assert words in whole and words in first
    for words in ("How it was found", "Provenance", "Each probability follows", "Largest deviations"):
        assert words in whole and words not in first


def test_every_check_and_every_extreme_place_has_a_row() -> None:
    inspection = example().inspection
    assert inspection is not None
    (checks,), (extremes,) = check_tables(inspection), extreme_tables(inspection)
    assert [row[0] for row in checks.rows] == [check.name for check in inspection.checks]
    assert {row[5] for row in checks.rows} <= {"passed", "failed", "not judged"}
    assert len(extremes.rows) == len(inspection.extremes)
    assert check_tables(None) == extreme_tables(None) == []


def test_the_head_names_the_part_the_files_the_job_and_the_date() -> None:
    header = ReportHeader(job="a1", created="2026-11-27T20:03:00+00:00").of_files(
        design="d.stl", scan="s.ply"
    )
    rows = identity(Reference(serial="A-17", more={"shift": "2"}), header)
    assert rows == [
        *(("serial", "A-17"), ("shift", "2"), ("design", "d.stl"), ("scan", "s.ply")),
        *(("date", "2026-11-27 20:03 UTC"), ("job", "a1")),
    ]
    assert ("Datum", "27.11.2026 20:03 UTC") in identity(None, header, Words("de"))
    assert identity(None, ReportHeader()) == []


def test_of_a_cloud_the_way_back_includes_the_spacing_of_its_points() -> None:
    result = example()
    assert result.deviation is not None
    notes = [
        tables.both_ways(result.deviation, result.deviation_of_design, is_cloud=is_cloud).note
        for is_cloud in (False, True)
    ]
    assert "spacing of the points" not in notes[0]
    assert notes[1] == f"{notes[0]} {tables.TO_POINTS}"
