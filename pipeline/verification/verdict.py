"""The verdict: may the pose be trusted? One status, the first that applies, and findings.

`units_suspect` > `mirrored` > `no_match` > `under_constrained` > `ambiguous` > `uncertain` > `ok`: each
defined in `judge`.
"""

from pipeline.core.results import Finding, Verdict, VerdictStatus
from pipeline.core.settings import RegistrationSettings
from pipeline.verification import findings
from pipeline.verification.evidence import (
    Case,
    evidence_records,
    pose,
    same_part,
    same_part_whatever_repeats,
)
from pipeline.verification.thresholds import VERDICT

#: Statuses with a pose; how far it can be trusted, the status says.
HAS_POSE: frozenset[VerdictStatus] = frozenset(
    {"ok", "units_suspect", "under_constrained", "ambiguous", "uncertain"}
)


def judge(case: Case, settings: RegistrationSettings) -> Verdict:
    """The verdict on one registration.

    units_suspect : the scan fits as `ok` asks after its numbers are multiplied by a unit factor, and not
    without;
    mirrored : the mirrored scan fits as `ok` asks, and leaves less than `mirror_gain` of the residual;
    no_match : too little of the scan lies on the design (`min_fitness`, `min_coverage`), or the evidence says
    that it is another part (`other_part`);
    under_constrained : a motion of the scan is less certain (1 sigma) than the tolerance, or
    `free_motion_share` of the diagonal;
    ambiguous : another pose, no symmetry of the design, scores less than `rival_margin` times the best (up to
    `loose_fit_margin` times, the looser the fit or the less accurate the scanner); or the mirrored scan fits
    better (`mirror_better_ratio`) and differs less in shape, but not by `mirror_gain`, or not as `ok` asks;
    or the scan is flat;
    uncertain : the pose is the best by that margin, but the evidence is not enough for `ok`: a probability
    below `ok_same_part` or `ok_pose`, a residual above its limit, a place where the shapes differ, or another
    size along one direction or all;
    ok : none of these.

    confidence : the product of `same_part` and `pose`; 0 without a pose.
    """
    part = same_part(case)
    too_little = findings.too_little(case, settings)
    other_part = [] if too_little else findings.other_part(case, part)
    mirrored = findings.mirrored(case, settings)
    pose_probability = pose(case, count_ties=not case.registration.observability.unconstrained)
    uncertain = [
        *findings.high_residual(case),
        *findings.differences(case),
        *findings.size_differences(case),
        *findings.flat_scan(case),
    ]
    is_sure = same_part_whatever_repeats(case) >= VERDICT.ok_same_part and pose_probability >= VERDICT.ok_pose
    is_sure = is_sure and not case.tight_fit.is_too_coarse
    status = _status(
        case,
        settings,
        is_misfit=bool(too_little or other_part),
        is_mirrored=mirrored is not None,
        is_uncertain=bool(uncertain) or not is_sure,
    )
    reasons: list[Finding] = []
    if status == "units_suspect" and case.checks.unit_factor is not None:
        reasons.append(findings.unit_factor(case.checks.unit_factor))
    if status == "mirrored" and mirrored is not None:
        reasons.append(mirrored)
    has_pose = status in HAS_POSE
    reasons += [*too_little, *other_part]
    if has_pose:
        reasons += [*uncertain, *findings.loose_fit(case, settings)]
    reasons += [*findings.mirror_fits_better(case, status), *findings.other_unit(case)]
    if status == "uncertain" and (not is_sure or findings.high_residual(case)):
        reasons += findings.what_would_settle(case)
    reasons += [
        *findings.unconstrained_motions(case),
        *findings.alternatives(case),
        *findings.weaknesses(case),
        *findings.not_calibrated(case),
    ]
    return Verdict(
        status=status,
        confidence=(part * pose_probability if case.is_fitted else None) if has_pose else 0.0,
        same_part=part if case.is_fitted else None,
        pose=pose_probability if case.is_fitted else None,
        evidence=evidence_records(case),
        findings=reasons,
    )


def _status(
    case: Case,
    settings: RegistrationSettings,
    *,
    is_misfit: bool,
    is_mirrored: bool,
    is_uncertain: bool,
) -> VerdictStatus:
    """The first that applies."""
    if case.checks.unit_factor is not None:
        return "units_suspect"
    if is_mirrored:
        return "mirrored"
    if is_misfit:
        return "no_match"
    if case.registration.observability.unconstrained:
        return "under_constrained"
    if case.has_close_alternative(settings) or case.mirror_fits_better() or case.tight_fit.is_flat:
        return "ambiguous"
    return "uncertain" if is_uncertain else "ok"
