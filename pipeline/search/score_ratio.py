"""How much worse another pose must fit for the best one to be the answer."""

from dataclasses import dataclass

from pipeline.core.settings import RegistrationSettings


@dataclass(frozen=True, slots=True)
class ScoreLimits:
    """Limits on the ratio of two scores. Part of `verification.thresholds`.

    loose_fit_share : of `max_residual_share`; above it a fit is loose. Chosen by hand: depth-camera scans lie
    at
    0.5 to 0.8 of the limit, printed copies below 0.2
    loose_fit_margin : score ratio required under a loose fit. Chosen by hand: a sixth of an arch fitted a
    wrong place at 1.57; a tighter fit needs less (`required_ratio`): one view of a nearly square part by a
    camera fitted a wrong pose, 0.32 % of the diagonal off, by 1.40
    numerical_floor_share : of the diagonal; RMS distances below it are rounding. Chosen by hand, well above
    the 1e-7 of the diagonal to which the closest-point query is exact
    """

    loose_fit_share: float = 0.4
    loose_fit_margin: float = 2.0
    numerical_floor_share: float = 1e-5


SCORE_LIMITS = ScoreLimits()


def score_ratio(score_mm2: float, best_mm2: float, diagonal_mm: float) -> float:
    """A score over the best one, dimensionless; both raised by the numerical floor, so that 0 / 0 is 1."""
    floor_mm2 = (SCORE_LIMITS.numerical_floor_share * diagonal_mm) ** 2
    return (score_mm2 + floor_mm2) / (best_mm2 + floor_mm2)


def is_loose(truncated_rms_mm: float, diagonal_mm: float, settings: RegistrationSettings) -> bool:
    """Whether the scan lies farther off the design than a good scanner and printer leave it."""
    return truncated_rms_mm > SCORE_LIMITS.loose_fit_share * settings.max_residual_share * diagonal_mm


def required_ratio(truncated_rms_mm: float, diagonal_mm: float, settings: RegistrationSettings) -> float:
    """Another pose whose score ratio is below this makes the best one ambiguous.

    From `rival_margin` for a fit without a residual it grows to `loose_fit_margin` for a loose one, in
    proportion to the residual: what is left is distortion too, and may favour a wrong pose.
    """
    loose_mm = SCORE_LIMITS.loose_fit_share * settings.max_residual_share * diagonal_mm
    looseness = min(1.0, truncated_rms_mm / loose_mm)
    return settings.rival_margin + looseness * max(0.0, SCORE_LIMITS.loose_fit_margin - settings.rival_margin)
