"""What is said of a pose follows from the evidence: margins, residuals, and a probability between 0 and 1."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.analysis.mesh_analysis import analyse
from pipeline.core.mesh import Mesh
from pipeline.core.timing import silent
from pipeline.search.score_ratio import LOOSE_MARGIN
from pipeline.verification import alternative_hypotheses as doubts
from pipeline.verification.verdict import CONFIDENCE, MOST_MARGIN, Case, evidence, judge, probability
from tests.support import shapes
from tests.support.designs import design_of
from tests.support.scans import noisy
from tests.support.settings import COARSE as QUICK

ASKED = doubts.Asked(QUICK, 0, None)
LIMITS = QUICK.registration


@pytest.fixture(scope="module")
def case() -> Case:
    """A blob's scan in place, without a rival."""
    part: Mesh = shapes.bumpy_blob(4)
    design = design_of(part, QUICK)
    scan = analyse(noisy(part, 5), "scan", design.scales, QUICK, silent(), 0)
    found = doubts.registered(scan, *doubts.matched(scan, design, ASKED), design, ASKED)
    found, doubted = doubts.examined(found, design, ASKED)
    marked = len(scan.landmarks.vertex)
    made = Case(
        found.registration,
        found.registration.matching,
        doubted,
        marked,
        design.diagonal_mm,
        ASKED.certain_mm(design),
    )
    return with_rival(made, None)


def with_rival(case: Case, times: float | None, *, residual_share: float | None = None) -> Case:
    """The same with one rival that scores `times` the best, and a residual of that share of its limit."""
    registration = case.registration
    best = registration.best
    rivals = () if times is None else (replace(best, score_mm2=times * best.score_mm2),)
    fit = registration.fit
    if residual_share is not None:
        fit = replace(fit, truncated_rms_mm=residual_share * LIMITS.max_residual_share * case.diagonal_mm)
    doubted = replace(case.doubts, symmetric=(False,) * len(rivals))
    return replace(case, registration=replace(registration, rivals=rivals, fit=fit), doubts=doubted)


def test_a_clear_pose_is_ok_and_more_likely_right_than_a_contested_one(case: Case) -> None:
    alone, contested = judge(case, LIMITS), judge(with_rival(case, 1.5), LIMITS)
    assert alone.status == contested.status == "ok"
    assert 0.5 < contested.confidence < alone.confidence < 1.0


def test_a_rival_within_the_margin_is_ambiguous_and_a_symmetry_is_no_rival(case: Case) -> None:
    close = with_rival(case, LIMITS.rival_margin - 0.05)
    assert judge(close, LIMITS).status == "ambiguous"
    symmetric = replace(close, doubts=replace(close.doubts, symmetric=(True,)))
    assert judge(symmetric, LIMITS).status == "ok"
    assert evidence(symmetric, LIMITS)[0] == MOST_MARGIN


def test_a_loose_fit_needs_the_wider_margin(case: Case) -> None:
    between = (LIMITS.rival_margin + LOOSE_MARGIN) / 2
    assert judge(with_rival(case, between, residual_share=0.2), LIMITS).status == "ok"
    loose = judge(with_rival(case, between, residual_share=0.9), LIMITS)
    assert loose.status == "ambiguous"
    assert {"loose_fit", "rival_pose"} <= {finding.code for finding in loose.findings}
    assert judge(with_rival(case, LOOSE_MARGIN + 0.1, residual_share=0.9), LIMITS).status == "ok"


def test_no_pose_no_confidence(case: Case) -> None:
    refused = judge(with_rival(case, None, residual_share=1.01), LIMITS)
    assert refused.status == "no_match"
    assert refused.confidence == 0.0


def test_evidence_stays_in_its_bounds(case: Case) -> None:
    found = evidence(with_rival(case, 1e9, residual_share=50.0), LIMITS)
    assert found[0] == MOST_MARGIN
    assert found[1] == 3.0
    assert 0.0 <= found[2] <= 1.0
    assert -3.0 <= found[3] <= 0.0
    assert 0.0 < found[4] <= 1.0


@given(st.lists(st.floats(0, 1), min_size=5, max_size=5), st.integers(0, 4))
def test_more_evidence_for_a_pose_never_lowers_its_probability(shares: list[float], which: int) -> None:
    low = np.array([0.0, 3.0, 0.0, -3.0, 0.0])
    high = np.array([MOST_MARGIN, 0.0, 1.0, 0.0, 1.0])
    here = low + np.array(shares) * (high - low)
    better = here.copy()
    better[which] = high[which]
    assert 0.0 < probability(CONFIDENCE, here) <= probability(CONFIDENCE, better) < 1.0
