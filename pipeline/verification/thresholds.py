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
    `ok`, where its difference of shape is not larger. Chosen by hand
    tie_ratio : score ratio below which nothing tells two poses apart. Chosen by hand
    ok_same_part, ok_pose : probabilities from which on a pose is `ok`; below, it is `uncertain`. Chosen by
    hand: of 58 other parts among the cases of the fit, with the corrected camera, three reached 0.86 to 0.88
    and none more, and no right pose of the 128 beside them that would be `ok` has less than 0.9
    other_part : probability of the same part below which the scan is of another. Chosen by hand on the same
    flat_noises, flat_share : of the scan's noise and of the diagonal; RMS thickness up to which a scan is
    flat. Chosen by hand
    max_accuracy_share : of the diagonal; a scanner of a larger stated accuracy shows too little for `ok`
    """

    ambiguity: ScoreLimits = SCORE_LIMITS
    alternative_note_ratio: float = 2.0
    weak_eigenvalue: float = 1e-3
    mirror_better_ratio: float = 0.9
    tie_ratio: float = 1.05
    ok_same_part: float = 0.9
    ok_pose: float = 0.9
    other_part: float = 0.25
    max_accuracy_share: float = 0.02
    flat_noises: float = 3.0
    flat_share: float = 0.002


@dataclass(frozen=True, slots=True)
class LogisticModel:
    """Probability = 1 / (1 + exp(-(intercept + sum of weight * value))), over named pieces of evidence.

    typical : median value of each for right poses of the right part; only for the contributions that are
    shown
    """

    names: tuple[str, ...]
    intercept: float
    weights: tuple[float, ...]
    typical: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class ConfidenceModel:
    """The two fitted models, and the ranges within which a piece of evidence counts.

    same_part, pose : fitted by `tests/accuracy/confidence.py` on simulated and real scans that the benchmark
    does not have, on one half of the shapes, judged on the other; what stands here is fitted on all of them
    max_lead : log score ratio beyond which a lead adds nothing (a ratio of 7.4). Chosen by hand before the
    fit
    residual_unit_share, detail_unit_share : of the diagonal; a residual and a detail are logarithms of their
    ratio to these. Chosen by hand before the fit; they set only the unit
    min_log10, max_log10 : range of these logarithms
    max_mirror_log10 : range of the logarithm of the mirror image's residual over that of the scan
    min_coverage : share of the design below which coverage counts no less. Chosen by hand before the fit
    """

    same_part: LogisticModel = LogisticModel(
        names=("residual", "detail", "normal_agreement", "matched_landmarks", "distinct_lead", "mirror"),
        intercept=-10.939,
        weights=(-1.159, -2.946, 11.338, 2.657, 1.477, 1.95),
        typical=(-1.103, -0.685, 0.963, 0.732, 2.0, 0.0),
    )
    pose: LogisticModel = LogisticModel(
        names=("lead", "coverage"),
        intercept=0.993,
        weights=(4.846, 1.274),
        typical=(2.0, -0.313),
    )
    max_lead: float = 2.0
    residual_unit_share: float = 0.009
    detail_unit_share: float = 0.002
    min_log10: float = -1.5
    max_log10: float = 0.7
    max_mirror_log10: float = 0.5
    min_coverage: float = 1e-3


@dataclass(frozen=True, slots=True)
class DifferenceLimits:
    """From when on a patch of one surface off the other is a difference of shape.

    cells_per_patch : cells (`SurfaceCells`) that the least patch holds. Chosen by hand: one cell is noise
    min_spreads : robust standard deviations of the means over cells, over the whole surface
    min_sigmas : standard deviations of the scanner as stated. The definition of "the scan can show it"
    min_residuals : of the residual of the whole scan, which holds its noise. Chosen by hand
    min_size_share : of the design's diagonal. Chosen by hand: prints warp by so much in places
    min_coarse_share : the same where a closed scan is looked up from the design. Chosen by hand
    min_area_share : area of the patch over that of the design. Chosen by hand
    deep_ratio : a patch so many times the limits off needs that part of the area only. Chosen on one filled
    hole of seed 3
    min_seen_past_share : area that the scanner saw past over that of the design. Chosen by hand: at the cut
    struts of a lattice 0.1 % looks so
    samples : of the design, each for the same area, that are looked up in the scan
    min_depth_ratio : depth in the design's material over the smallest visible distance, from which on the
    scanner saw past it, or through it. Chosen by hand
    max_unseen_share : of a body of the design that the scan shows, up to which it is missing, where at least
    min_rest_seen : of the area of the other bodies is shown. Chosen by hand
    min_through_share : area of the scan behind material of such depth over that of the design. Chosen on
    seeds 1000 and 2001: a missing rib of 1.2 mm leaves 0.12 %, right parts up to 0.015 %
    whole_triangle_ratio : of the smallest visible distance, that all corners of a triangle lie off at least
    where it confirms a difference (`chord_errors`). Chosen by hand: corners on the surface leave less
    hidden_share : of a body that the design itself covers, from which on it is a cavity. Chosen by hand
    ray_start_share : of the diagonal, by which the rays of that test start off the surface
    """

    cells_per_patch: float = 4.0
    min_spreads: float = 8.0
    min_sigmas: float = 4.0
    min_residuals: float = 4.0
    min_size_share: float = 0.003
    min_coarse_share: float = 0.006
    min_area_share: float = 0.0005
    deep_ratio: float = 2.0
    min_depth_ratio: float = 0.4
    min_seen_past_share: float = 0.002
    samples: int = 20_000
    max_unseen_share: float = 0.02
    min_rest_seen: float = 0.6
    min_through_share: float = 0.0005
    whole_triangle_ratio: float = 0.5
    hidden_share: float = 0.9
    ray_start_share: float = 1e-4


@dataclass(frozen=True, slots=True)
class SizeLimits:
    """From when on a uniform strain of the scan is another size of the part, not a print's or a scanner's.

    min_stretch : difference of the strains along two directions. Chosen on seed 1000 of the benchmark: prints
    that warp by 0.3 % of the diagonal (RMS) show up to 2.1 %
    min_size : strain that is the same along all axes. Chosen by hand: castings and prints shrink by up to 2 %
    min_over_left : RMS distance that the strain explains over the RMS over patches of what it does not.
    Chosen on the same seed: right parts reach 6.9, parts that are 4 % longer 15 to 48 by structured
    light, and 4 to 13 where they warp too
    max_over_residual : RMS distance that the strain explains over the residual, beyond which the estimate has
    diverged: it cannot explain more than there is. Derived, with some room
    max_strain : beyond it the surface does not determine the strain, as of a flat view. Chosen by hand
    samples : of the scan. Chosen by hand: 40 for each patch
    """

    min_stretch: float = 0.025
    min_size: float = 0.025
    min_over_left: float = 7.0
    max_over_residual: float = 1.2
    max_strain: float = 0.15
    samples: int = 4_000


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
    repeat_share : RMS, of the diagonal, up to which the design repeats itself at another pose. Chosen by hand
    on a bookshelf of eight equal boxes seen by a camera (0.30 to 0.48 %); of 40 other parts one has 0.45 %,
    the rest 0.52 % and more
    repeat_fitness : share of the scan that lies on the design, from which on that is asked. Chosen by hand
    mirror_sample_margin : times `mirror_gain`: the mirrored scan's samples lie off by more, and not every
    vertex is looked at. Chosen by hand: the two RMS differ by a few percent
    """

    symmetry_better_ratio: float = 0.95
    symmetry_better_share: float = 0.0001
    whole_part_ratio: float = 0.9
    min_size_ratio: float = 0.3
    max_size_ratio: float = 1.4
    equal_pose_share: float = 0.0005
    repeat_share: float = 0.005
    repeat_fitness: float = 0.9
    mirror_sample_margin: float = 1.2


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
DIFFERENCE = DifferenceLimits()
SIZE = SizeLimits()
