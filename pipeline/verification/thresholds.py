"""Every limit of the verdict that is not in `Settings`, in one place.

Limits that users may set are in `Settings.registration`. All of these are in the results under
`provenance.limits.verdict`. "Fitted" names what on; "chosen by hand" means: set while looking at the
development shapes of the benchmark, so those shapes are no independent test of the limit.
"""

from dataclasses import dataclass

from pipeline.search.score_ratio import SCORE_LIMITS, ScoreLimits


@dataclass(frozen=True, slots=True)
class VerdictThresholds:
    """Limits of `verdict.judge`.

    ambiguity : see `search.score_ratio`
    alternative_note_ratio : score ratio below which an alternative is reported. Chosen by hand: the largest
    margin that is required
    weak_eigenvalue : of the point-to-plane Hessian (rotations scaled by the RMS radius, dimensionless), below
    which `weakly_constrained` is reported. Chosen by hand
    mirror_better_ratio : residual of the mirrored scan over that of the scan, below which the pose is not
    `ok`. Chosen by hand
    tie_ratio : score ratio below which nothing tells two poses apart. Chosen by hand
    """

    ambiguity: ScoreLimits = SCORE_LIMITS
    alternative_note_ratio: float = 2.0
    weak_eigenvalue: float = 1e-3
    mirror_better_ratio: float = 0.9
    tie_ratio: float = 1.05


@dataclass(frozen=True, slots=True)
class ConfidenceModel:
    """Logistic regression of "the pose is right" on `verdict.evidence`.

    intercept, weights : fitted by `tests/accuracy/confidence.py` on registrations that the benchmark does not
    have (other seeds, pieces down to 15 %, noise up to 1 %, warp up to 2 %); the same order as the evidence
    max_lead : log score ratio beyond which a lead adds nothing (a ratio of 7.4). Chosen by hand before the
    fit
    max_residual : residual over its limit, beyond which it counts no more. Chosen by hand before the fit
    min_coverage : share of the design below which coverage counts no less. Chosen by hand before the fit
    """

    intercept: float = 0.74
    weights: tuple[float, ...] = (1.26, -1.89, 1.5, 0.25, 0.39)
    max_lead: float = 2.0
    max_residual: float = 3.0
    min_coverage: float = 1e-3


@dataclass(frozen=True, slots=True)
class HypothesisLimits:
    """Limits of `alternative_hypotheses.verify_hypotheses`.

    symmetry_better_ratio : cost of a symmetry-equivalent pose over that of the best, below which it is the
    better pose (a small mark distinguishes them), by more than
    symmetry_better_share : of the diagonal, squared. Chosen by hand
    whole_part_ratio : scan diagonal over design diagonal from which a scan in another unit is a whole part,
    which may turn freely (a bolt in inches is a bolt). Chosen by hand
    min_size_ratio, max_size_ratio : scan diagonal over design diagonal for which another unit is tried: a
    part of it, or the whole with some surroundings. Chosen by hand
    equal_pose_share : RMS, of the diagonal, that a symmetry-equivalent pose may leave above the best.
    Derived: the RMS up to which a motion is a symmetry (`SymmetrySchedule.rms_share`)
    """

    symmetry_better_ratio: float = 0.95
    symmetry_better_share: float = 0.0001
    whole_part_ratio: float = 0.9
    min_size_ratio: float = 0.3
    max_size_ratio: float = 1.4
    equal_pose_share: float = 0.0005


#: The scan's numbers times this are mm, where they were read as mm; each with the name of the mix-up.
#: Definitions.
UNIT_FACTORS = {
    25.4: "inches read as mm",
    1 / 25.4: "mm read as inches",
    10.0: "cm read as mm",
    0.1: "mm read as cm",
    1000.0: "metres read as mm",
    0.001: "mm read as metres",
}

VERDICT = VerdictThresholds()
CONFIDENCE = ConfidenceModel()
HYPOTHESES = HypothesisLimits()
