"""What was found about hypotheses other than the best pose."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class MirrorCheck:
    """The mirrored scan under its best pose. rms_mm : truncated RMS distance; detail_mm : difference of shape
    (`SurfaceEvidence`), None where it fits no better than the scan itself; same_part, pose : probabilities
    that it is of the design, and that its pose is right; None where it fits not much better, so that they
    were not asked; is_tight : whether it fits as tightly as `ok` asks (`TightFit`)
    """

    rms_mm: float
    detail_mm: float | None = None
    same_part: float | None = None
    pose: float | None = None
    is_tight: bool = False


@dataclass(frozen=True, slots=True)
class HypothesisChecks:
    """unit_factor : the only one under which the scan fits, as surely as `ok` asks, None for mm; mirrored :
    None where that was not tested; symmetric : for each alternative pose whether it is equivalent by a
    symmetry of the design; loose_unit_factor : one under which the scan lies on the design, but not as
    surely; repeats : for each alternative pose whether the design repeats itself there (`repeats`), None
    where that was not asked
    """

    unit_factor: float | None
    mirrored: MirrorCheck | None
    symmetric: tuple[bool, ...]
    loose_unit_factor: float | None = None
    repeats: tuple[bool, ...] | None = None
