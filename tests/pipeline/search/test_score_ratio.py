"""The ratio of two scores, and the margin that it must exceed."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.core.settings import RegistrationSettings
from pipeline.search.score_ratio import SCORE_LIMITS, is_loose, required_ratio, score_ratio

SETTINGS = RegistrationSettings()
DIAGONAL_MM = 100.0
LIMIT_MM = SETTINGS.max_residual_share * DIAGONAL_MM


def test_two_scores_of_rounding_errors_are_equal() -> None:
    """Without the floor, 1e-18 over 1e-20 would be a clear lead."""
    assert score_ratio(0.0, 0.0, DIAGONAL_MM) == 1.0
    assert score_ratio(1e-18, 1e-20, DIAGONAL_MM) == pytest.approx(1.0)


@given(st.floats(1e-4, 1e4), st.floats(1.0, 100.0))
def test_well_above_the_floor_it_is_the_plain_ratio(best_mm2: float, ratio: float) -> None:
    assert score_ratio(ratio * best_mm2, best_mm2, DIAGONAL_MM) == pytest.approx(ratio, rel=0.02)


def test_a_loose_fit_needs_the_wider_margin() -> None:
    tight_mm = 0.99 * SCORE_LIMITS.loose_fit_share * LIMIT_MM
    loose_mm = 1.01 * SCORE_LIMITS.loose_fit_share * LIMIT_MM
    assert not is_loose(tight_mm, DIAGONAL_MM, SETTINGS) and is_loose(loose_mm, DIAGONAL_MM, SETTINGS)
    assert required_ratio(loose_mm, DIAGONAL_MM, SETTINGS) == SCORE_LIMITS.loose_fit_margin
    assert required_ratio(0.0, DIAGONAL_MM, SETTINGS) == SETTINGS.rival_margin


@given(st.floats(0.0, 2.0))
def test_the_margin_grows_with_the_residual(share: float) -> None:
    """Linearly, from one to the other; a margin that the user sets wider stays."""
    loose_mm = SCORE_LIMITS.loose_fit_share * LIMIT_MM
    low, high = SETTINGS.rival_margin, SCORE_LIMITS.loose_fit_margin
    expected = low + min(share, 1.0) * (high - low)
    assert required_ratio(share * loose_mm, DIAGONAL_MM, SETTINGS) == pytest.approx(expected)
    wide = SETTINGS.model_copy(update={"rival_margin": 3.0})
    assert required_ratio(share * loose_mm, DIAGONAL_MM, wide) == 3.0
