"""The verdict: may the pose be trusted? One status, the first that applies, and findings.

`units_suspect` > `mirrored` > `no_match` > `under_constrained` > `ambiguous` > `ok`: each defined in `judge`.
"""

from pipeline.core.results import Finding, Verdict, VerdictStatus
from pipeline.core.settings import RegistrationSettings
from pipeline.verification import findings
from pipeline.verification.evidence import Case, confidence

#: Statuses with a pose; how far it can be trusted, the status says.
HAS_POSE: frozenset[VerdictStatus] = frozenset({"ok", "units_suspect", "under_constrained", "ambiguous"})


def judge(case: Case, settings: RegistrationSettings) -> Verdict:
    """The verdict on one registration.

    units_suspect : the scan fits after its numbers are multiplied by a unit factor, and not without;
    mirrored : the mirrored scan fits and leaves less than `mirror_gain` of the residual;
    no_match : too little of the scan lies on the design (`min_fitness`, `min_coverage`), or too far off it
    (`max_residual_share`);
    under_constrained : a motion of the scan is less certain (1 sigma) than the tolerance, or
    `free_motion_share` of the diagonal;
    ambiguous : another pose, no symmetry of the design, scores less than `rival_margin` times the best (under
    a loose fit, `loose_fit_margin` times); or the mirrored scan fits better (`mirror_better_ratio`), but not
    by `mirror_gain`.

    confidence : see `evidence.confidence`; 0 without a pose.
    """
    misfit = findings.misfit(case, settings)
    mirrored = findings.mirrored(case, settings)
    status = _status(case, settings, is_misfit=bool(misfit), is_mirrored=mirrored is not None)
    reasons: list[Finding] = []
    if status == "units_suspect" and case.checks.unit_factor is not None:
        reasons.append(findings.unit_factor(case.checks.unit_factor))
    if status == "mirrored" and mirrored is not None:
        reasons.append(mirrored)
    reasons += misfit
    if not misfit:
        reasons += [*findings.loose_fit(case, settings), *findings.mirror_fits_better(case, status)]
    reasons += [
        *findings.unconstrained_motions(case),
        *findings.alternatives(case),
        *findings.weaknesses(case),
    ]
    has_pose = status in HAS_POSE
    count_ties = status != "under_constrained"
    return Verdict(
        status=status,
        confidence=confidence(case, settings, count_ties=count_ties) if has_pose else 0.0,
        findings=reasons,
    )


def _status(
    case: Case, settings: RegistrationSettings, *, is_misfit: bool, is_mirrored: bool
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
    if case.has_close_alternative(settings) or case.mirror_fits_better():
        return "ambiguous"
    return "ok"
