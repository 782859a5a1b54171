"""What is said of a pose follows from the evidence: margins, residuals, and a probability between 0 and 1."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.analysis.mesh_analysis import analyse_mesh
from pipeline.analysis.scan_registration import match_scan, register_scan
from pipeline.core.job_parameters import JobParameters
from pipeline.core.mesh import Mesh
from pipeline.core.results import Verdict
from pipeline.core.settings import Settings
from pipeline.core.timing import silent
from pipeline.kernels.surface_patches import Patch
from pipeline.search.score_ratio import SCORE_LIMITS
from pipeline.verification.alternative_hypotheses import verify_hypotheses
from pipeline.verification.evidence import Case, evidence, holds_for, probability
from pipeline.verification.scan_quality import assess_quality
from pipeline.verification.thresholds import CONFIDENCE, VERDICT
from pipeline.verification.verdict import judge
from tests.support import shapes
from tests.support.designs import design_of
from tests.support.scans import noisy
from tests.support.settings import COARSE as QUICK

JOB = JobParameters(QUICK, 0, None)
MAX_LEAD, LOOSE_MARGIN = CONFIDENCE.max_lead, SCORE_LIMITS.loose_fit_margin
LIMITS = QUICK.registration
MODELS = (CONFIDENCE.same_part, CONFIDENCE.pose)
#: For each piece of evidence its range, from what speaks against the pose to what speaks for it.
RANGES = {
    "residual": (CONFIDENCE.max_log10, CONFIDENCE.min_log10),
    "detail": (CONFIDENCE.max_log10, CONFIDENCE.min_log10),
    "normal_agreement": (0.0, 1.0),
    "matched_landmarks": (0.0, 1.0),
    "lead": (0.0, MAX_LEAD),
    "distinct_lead": (0.0, MAX_LEAD),
    "coverage": (float(np.log10(CONFIDENCE.min_coverage)), 0.0),
}


@pytest.fixture(scope="module")
def case() -> Case:
    """A blob's scan in place, without an alternative."""
    part: Mesh = shapes.bumpy_blob(4)
    design, scan_mesh = design_of(part, QUICK), noisy(part, 5)
    scan = analyse_mesh(scan_mesh, "scan", design.scales, QUICK, silent(), 0)
    registered = register_scan(match_scan(scan, design, JOB), design, JOB)
    quality = assess_quality(scan_mesh, design.diagonal_mm, JOB)
    registered, checks = verify_hypotheses(registered, quality, design, JOB)
    return with_alternative(Case.of(registered, checks, quality, design, JOB), None)


def with_alternative(case: Case, times: float | None, *, residual_share: float | None = None) -> Case:
    """The same with one alternative that scores `times` the best, and a residual of that share of its
    limit.
    """
    registration = case.registration
    best = registration.best
    alternatives = () if times is None else (replace(best, score_mm2=times * best.score_mm2),)
    fit = registration.fit
    if residual_share is not None:
        fit = replace(fit, truncated_rms_mm=residual_share * case.quality.residual_limit_mm)
    none = (False,) * len(alternatives)
    checks = replace(case.checks, symmetric=none, repeats=none)
    return replace(
        case, registration=replace(registration, alternatives=alternatives, fit=fit), checks=checks
    )


def with_surfaces(case: Case, **changed: float) -> Case:
    return replace(case, surfaces=replace(case.surfaces, **changed))


def codes(verdict: Verdict) -> set[str]:
    return {finding.code for finding in verdict.findings}


def test_a_clear_pose_is_ok_and_more_likely_right_than_a_contested_one(case: Case) -> None:
    alone, contested = judge(case, LIMITS), judge(with_alternative(case, 1.5), LIMITS)
    assert alone.status == contested.status == "ok"
    assert alone.confidence is not None and contested.confidence is not None
    assert 0.5 < contested.confidence < alone.confidence < 1.0


def test_confidence_is_the_product_of_the_two_probabilities(case: Case) -> None:
    verdict = judge(case, LIMITS)
    assert verdict.same_part is not None and verdict.pose is not None
    assert verdict.confidence == pytest.approx(verdict.same_part * verdict.pose)


def test_each_probability_follows_from_the_evidence_shown(case: Case) -> None:
    verdict = judge(with_alternative(case, 1.7), LIMITS)
    for name, model, said in zip(
        ("same_part", "pose"), MODELS, (verdict.same_part, verdict.pose), strict=True
    ):
        rows = [row for row in verdict.evidence if row.of == name]
        total = model.intercept + sum(row.value * row.weight for row in rows)
        assert said == pytest.approx(1 / (1 + np.exp(-total)))
        typical = dict(zip(model.names, model.typical, strict=True))
        for row in rows:
            assert row.contribution == pytest.approx(row.weight * (row.value - typical[row.name]))


def test_an_alternative_within_the_margin_is_ambiguous_and_a_symmetry_is_none(case: Case) -> None:
    close = with_alternative(case, LIMITS.rival_margin - 0.05)
    assert judge(close, LIMITS).status == "ambiguous"
    symmetric = replace(close, checks=replace(close.checks, symmetric=(True,)))
    assert judge(symmetric, LIMITS).status == "ok"
    assert evidence(symmetric)["lead"] == MAX_LEAD


def test_a_pose_at_which_the_design_repeats_itself_is_ambiguous_but_no_other_part(case: Case) -> None:
    alone, close = with_alternative(case, None), with_alternative(case, LIMITS.rival_margin - 0.05)
    repeated = replace(close, checks=replace(close.checks, repeats=(True,)))
    found, alike, other = (judge(each, LIMITS) for each in (alone, repeated, close))
    assert alike.status == "ambiguous"
    assert alike.pose == other.pose
    assert alike.same_part == pytest.approx(found.same_part)
    assert other.same_part is not None and found.same_part is not None
    assert other.same_part < found.same_part


def test_a_loose_fit_needs_the_wider_margin(case: Case) -> None:
    between = (LIMITS.rival_margin + LOOSE_MARGIN) / 2
    assert judge(with_alternative(case, between, residual_share=0.1), LIMITS).status == "ok"
    loose = judge(with_alternative(case, between, residual_share=0.9), LIMITS)
    assert loose.status == "ambiguous"
    assert {"loose_fit", "rival_pose"} <= codes(loose)


def test_a_residual_above_its_limit_is_uncertain_not_refused(case: Case) -> None:
    """Normals and shape agree: the part is right, the scanner may be coarse."""
    verdict = judge(with_alternative(case, None, residual_share=1.05), LIMITS)
    assert verdict.status == "uncertain"
    assert {"high_residual", "accuracy_unknown"} <= codes(verdict)


def test_an_uncertain_verdict_says_what_would_settle_it(case: Case) -> None:
    weak = with_surfaces(with_alternative(case, None, residual_share=0.9), normal_agreement=0.6)
    weak = with_surfaces(weak, detail_mm=0.003 * case.diagonal_mm)
    for accuracy_mm, code in (
        (None, "accuracy_unknown"),
        (0.001 * case.diagonal_mm, "scan_more"),
        (0.03 * case.diagonal_mm, "accuracy_too_coarse"),
    ):
        verdict = judge(replace(weak, quality=replace(weak.quality, accuracy_mm=accuracy_mm)), LIMITS)
        assert verdict.status == "uncertain" and code in codes(verdict)


def test_evidence_of_another_part_is_no_match(case: Case) -> None:
    other = with_surfaces(
        with_alternative(case, 1.02, residual_share=1.4),
        normal_agreement=0.4,
        detail_mm=0.006 * case.diagonal_mm,
    )
    refused = judge(other, LIMITS)
    assert refused.status == "no_match" and "other_part" in codes(refused)
    assert refused.confidence == 0.0 and refused.same_part is not None
    assert refused.same_part < VERDICT.other_part


def test_a_local_difference_is_not_silently_ok(case: Case) -> None:
    patch = Patch(np.zeros(3), 20.0, -1.0, -1.5)
    missing = judge(replace(case, surfaces=replace(case.surfaces, scan_patch=patch)), LIMITS)
    assert missing.status == "uncertain" and "missing_material" in codes(missing)
    assert "accuracy_unknown" not in codes(missing)  # it would settle nothing
    burr = replace(patch, mean=1.0, peak=1.5)
    extra = judge(replace(case, surfaces=replace(case.surfaces, scan_patch=burr)), LIMITS)
    assert extra.status == "uncertain" and "local_difference" in codes(extra)


def test_a_flat_scan_is_ambiguous(case: Case) -> None:
    """It fits on any flat: at best one of two."""
    flat = judge(with_surfaces(case, thickness_mm=0.01), LIMITS)
    assert flat.status == "ambiguous" and "flat_scan" in codes(flat)
    assert flat.pose is not None and flat.pose <= 0.5


def test_too_little_on_the_design_is_no_match_whatever_the_evidence(case: Case) -> None:
    fit = replace(case.registration.fit, fitness=LIMITS.min_fitness - 0.01)
    refused = judge(replace(case, registration=replace(case.registration, fit=fit)), LIMITS)
    assert refused.status == "no_match" and "low_fitness" in codes(refused)


def test_settings_that_the_models_were_not_fitted_with_give_no_probability(case: Case) -> None:
    verdict = judge(replace(case, is_fitted=False), LIMITS)
    assert verdict.confidence is None and verdict.same_part is None and verdict.pose is None
    assert "confidence_not_calibrated" in codes(verdict)


@pytest.mark.parametrize(
    ("changed", "is_fitted"),
    [
        ({}, True),
        ({"resample": {"target_vertices": 2500}}, True),  # moves no piece of evidence
        ({"landmarks": {"count": 5}}, False),
        ({"matching": {"length_share": 0.004}}, False),
        ({"registration": {"inlier_share": 0.05}}, False),
        ({"resample": {"enabled": False}}, False),
    ],
)
def test_the_models_hold_for_settings_that_leave_the_evidence(
    changed: dict[str, object], is_fitted: bool
) -> None:
    assert holds_for(Settings.model_validate(changed)) is is_fitted


def test_evidence_stays_in_its_bounds(case: Case) -> None:
    found = evidence(with_alternative(case, 1e9, residual_share=50.0))
    assert set(found) == set(RANGES) | {"mirror"}
    assert found["lead"] == MAX_LEAD
    for name, (against, in_favour) in RANGES.items():
        assert min(against, in_favour) <= found[name] <= max(against, in_favour)


@given(st.lists(st.floats(0, 1), min_size=7, max_size=7), st.sampled_from(sorted(RANGES)))
def test_more_evidence_for_a_pose_never_lowers_its_probability(shares: list[float], which: str) -> None:
    here = {"mirror": 0.0}
    for share, (name, (against, in_favour)) in zip(shares, RANGES.items(), strict=True):
        here[name] = against + share * (in_favour - against)
    better = here | {which: RANGES[which][1]}
    for model in MODELS:
        assert 0.0 < probability(model, here) <= probability(model, better) <= 1.0


def test_the_limit_of_the_residual_follows_from_scanner_tolerance_and_part() -> None:
    """Independent contributions add as squares."""
    settings = Settings()
    alone = JobParameters.of(settings, 0, None, None).residual_limit_mm(100.0)
    assert alone == pytest.approx(settings.registration.max_residual_share * 100.0)
    both = JobParameters.of(settings, 0, 0.3, 0.4).residual_limit_mm(100.0)
    assert both == pytest.approx(np.sqrt(alone**2 + (1.5 * 0.4) ** 2 + 0.3**2))
