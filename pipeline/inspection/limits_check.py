"""A value against its limits: the decision rule."""

from pipeline.core.acceptance import Acceptance
from pipeline.core.sentences import sentence


def passes(
    value: float | None, lower: float | None, upper: float | None, uncertainty: float | None
) -> bool | None:
    """Whether `value` is between the limits; None: no value, or too near a limit to be proven.

    uncertainty : expanded uncertainty of the measurement (ISO 14253-1): a value is within only when it stays
    so after moving by this much, and outside only when it stays outside; None: simple acceptance, a value on
    the limit is within
    """
    if value is None:
        return None
    guard = uncertainty or 0.0
    if (lower is not None and value < lower - guard) or (upper is not None and value > upper + guard):
        return False
    inside = (lower is None or value >= lower + guard) and (upper is None or value <= upper - guard)
    return True if inside else None


def rule(acceptance: Acceptance) -> str:
    """The decision rule in words, for results and reports."""
    if acceptance.uncertainty_mm is None:
        return sentence("simple acceptance: a value on or between its limits passes")
    return sentence(
        "ISO 14253-1 with an expanded uncertainty (k = 2) of {uncertainty:g} mm: a length passes if it is "
        "within its limits by at least that, fails if it is outside by more than that, and is not judged "
        "between; shares by simple acceptance",
        uncertainty=acceptance.uncertainty_mm,
    )
