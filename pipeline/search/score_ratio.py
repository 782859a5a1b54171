"""How much worse another pose must fit for the best one to be the answer."""

from pipeline.core.settings import RegistrationSettings

LOOSE = 0.4  # of the residual limit: depth-camera scans lie at 0.5 to 0.8, printed copies below 0.2
LOOSE_MARGIN = 2.0  # a rough fit says less: a sixth of an arch was `ok` in a wrong place, 0.85 % of the diagonal off, at 1.57


NOTHING_SHARE = 1e-5  # of the diagonal: what two poses leave below this is rounding, and tells neither


def ratio(score_mm2: float, best_mm2: float, diagonal_mm: float) -> float:
    """How many times the best a score is, where both leave more than nothing."""
    nothing = (NOTHING_SHARE * diagonal_mm) ** 2
    return (score_mm2 + nothing) / (best_mm2 + nothing)


def is_loose(truncated_rms_mm: float, diagonal_mm: float, settings: RegistrationSettings) -> bool:
    """The scan lies farther off the design than a good scanner and printer leave."""
    return truncated_rms_mm > LOOSE * settings.max_residual_share * diagonal_mm


def needed(truncated_rms_mm: float, diagonal_mm: float, settings: RegistrationSettings) -> float:
    """Another pose that scores less than this many times the best makes it ambiguous."""
    return LOOSE_MARGIN if is_loose(truncated_rms_mm, diagonal_mm, settings) else settings.rival_margin
