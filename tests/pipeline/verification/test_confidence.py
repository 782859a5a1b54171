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
from pipeline.core.timing import silent
from pipeline.search.score_ratio import SCORE_LIMITS
from pipeline.verification.alternative_hypotheses import verify_hypotheses
from pipeline.verification.evidence import Case, evidence, probability
from pipeline.verification.thresholds import CONFIDENCE
from pipeline.verification.verdict import judge
from tests.support import shapes
from tests.support.designs import design_of
from tests.support.scans import noisy
from tests.support.settings import COARSE as QUICK

JOB = JobParameters(QUICK, 0, None)
MAX_LEAD, LOOSE_MARGIN = CONFIDENCE.max_lead, SCORE_LIMITS.loose_fit_margin
WEIGHTS = np.array([CONFIDENCE.intercept, *CONFIDENCE.weights])
LIMITS = QUICK.registration


@pytest.fixture(scope="module")
def case() -> Case:
    """A blob's scan in place, without an alternative."""
    part: Mesh = shapes.bumpy_blob(4)
    design = design_of(part, QUICK)
    scan = analyse_mesh(noisy(part, 5), "scan", design.scales, QUICK, silent(), 0)
    registered = register_scan(match_scan(scan, design, JOB), design, JOB)
    registered, checks = verify_hypotheses(registered, design, JOB)
    return with_alternative(Case.of(registered, checks, design, JOB), None)


def with_alternative(case: Case, times: float | None, *, residual_share: float | None = None) -> Case:
    """The same with one alternative that scores `times` the best, and a residual of that share of its
    limit.
    """
    registration = case.registration
    best = registration.best
    alternatives = () if times is None else (replace(best, score_mm2=times * best.score_mm2),)
    fit = registration.fit
    if residual_share is not None:
        fit = replace(fit, truncated_rms_mm=residual_share * LIMITS.max_residual_share * case.diagonal_mm)
    checks = replace(case.checks, symmetric=(False,) * len(alternatives))
    return replace(
        case, registration=replace(registration, alternatives=alternatives, fit=fit), checks=checks
    )


def test_a_clear_pose_is_ok_and_more_likely_right_than_a_contested_one(case: Case) -> None:
    alone, contested = judge(case, LIMITS), judge(with_alternative(case, 1.5), LIMITS)
    assert alone.status == contested.status == "ok"
    assert 0.5 < contested.confidence < alone.confidence < 1.0


def test_an_alternative_within_the_margin_is_ambiguous_and_a_symmetry_is_none(case: Case) -> None:
    close = with_alternative(case, LIMITS.rival_margin - 0.05)
    assert judge(close, LIMITS).status == "ambiguous"
    symmetric = replace(close, checks=replace(close.checks, symmetric=(True,)))
    assert judge(symmetric, LIMITS).status == "ok"
    assert evidence(symmetric, LIMITS)[0] == MAX_LEAD


def test_a_loose_fit_needs_the_wider_margin(case: Case) -> None:
    between = (LIMITS.rival_margin + LOOSE_MARGIN) / 2
    assert judge(with_alternative(case, between, residual_share=0.2), LIMITS).status == "ok"
    loose = judge(with_alternative(case, between, residual_share=0.9), LIMITS)
    assert loose.status == "ambiguous"
    assert {"loose_fit", "rival_pose"} <= {finding.code for finding in loose.findings}
    assert judge(with_alternative(case, LOOSE_MARGIN + 0.1, residual_share=0.9), LIMITS).status == "ok"


def test_no_pose_no_confidence(case: Case) -> None:
    refused = judge(with_alternative(case, None, residual_share=1.01), LIMITS)
    assert refused.status == "no_match"
    assert refused.confidence == 0.0


def test_evidence_stays_in_its_bounds(case: Case) -> None:
    found = evidence(with_alternative(case, 1e9, residual_share=50.0), LIMITS)
    assert found[0] == MAX_LEAD
    assert found[1] == 3.0
    assert 0.0 <= found[2] <= 1.0
    assert -3.0 <= found[3] <= 0.0
    assert 0.0 < found[4] <= 1.0


@given(st.lists(st.floats(0, 1), min_size=5, max_size=5), st.integers(0, 4))
def test_more_evidence_for_a_pose_never_lowers_its_probability(shares: list[float], which: int) -> None:
    low = np.array([0.0, 3.0, 0.0, -3.0, 0.0])
    high = np.array([MAX_LEAD, 0.0, 1.0, 0.0, 1.0])
    here = low + np.array(shares) * (high - low)
    better = here.copy()
    better[which] = high[which]
    assert 0.0 < probability(WEIGHTS, here) <= probability(WEIGHTS, better) < 1.0
