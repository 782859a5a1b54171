"""May the pose be trusted? This version tells `ok` from `no_match` and lists what a person should know.

Not in this version: `units_suspect`, `mirrored`, `under_constrained`, `ambiguous` (design section 4). A near-equal
second pose and weak observability are reported as findings meanwhile, whatever the status.
"""

from pipeline.outcome import Finding, Verdict
from pipeline.settings import RegistrationSettings
from pipeline.stages.matching import Matching
from pipeline.stages.registration import Registration

RIVAL_MARGIN = 1.2  # a second pose with a truncated cost below this many times the best is worth a finding
WEAK_EIGENVALUE = 1e-3
LOOSE = 0.4  # of the residual limit: mirrored arches lie at 0.7, depth-camera scans at 0.5 to 0.8, others below 0.2


def judge(
    registration: Registration, matching: Matching, diagonal_mm: float, settings: RegistrationSettings
) -> Verdict:
    """`no_match` when too little of the scan lies on the design, or lies too far off it.

    confidence = fitness x (1 - residual / limit) x (1 - best cost / second pose's cost): a heuristic, not a
    calibrated probability.
    """
    fit, findings = registration.fit, []
    limit_mm = settings.max_residual_share * diagonal_mm
    if fit.fitness < settings.min_fitness:
        findings.append(
            Finding(
                code="low_fitness",
                detail=f"{fit.fitness:.0%} of the scan lies within {registration.inlier_distance_mm:.3g} mm "
                f"of the design; {settings.min_fitness:.0%} are needed",
                value=fit.fitness,
            )
        )
    if fit.truncated_rms_mm > limit_mm:
        findings.append(
            Finding(
                code="high_residual",
                detail=f"the scan is {fit.truncated_rms_mm:.3g} mm off the design (RMS, each distance counted as at "
                f"most {registration.inlier_distance_mm:.3g} mm); up to {limit_mm:.3g} mm count as the same part",
                value=fit.truncated_rms_mm,
            )
        )
    matched = not findings
    if matched and fit.truncated_rms_mm > LOOSE * limit_mm:
        findings.append(
            Finding(
                code="loose_fit",
                detail=f"the scan is {fit.truncated_rms_mm:.3g} mm off the design (RMS), more than a good scanner "
                "and printer leave: a rough scan, or a mirrored or similar part; look at the aligned meshes",
                value=fit.truncated_rms_mm,
            )
        )
    margin = 1.0
    if registration.rivals:
        second = registration.rivals[0].cost_mm2
        margin = 1.0 - registration.best.cost_mm2 / second if second > 0 else 0.0
        if second < RIVAL_MARGIN * registration.best.cost_mm2 or second == 0:
            findings.append(
                Finding(
                    code="rival_pose",
                    detail="another pose fits almost as well, see alternatives: symmetric, or too little to go by",
                    value=second / registration.best.cost_mm2 if registration.best.cost_mm2 > 0 else None,
                )
            )
    if registration.eigenvalues[0] < WEAK_EIGENVALUE:
        findings.append(
            Finding(
                code="weakly_constrained",
                detail="the surfaces hardly notice one of the six motions (a turn or a slide): check the pose",
                value=float(registration.eigenvalues[0]),
            )
        )
    if matching.T_landmarks is None:
        findings.append(
            Finding(
                code="few_landmarks",
                detail=f"{len(matching.design)} landmarks match, too few to fix a pose by landmarks alone; "
                f"it came from {registration.seed} hypotheses",
                value=float(len(matching.design)),
            )
        )
    if not registration.best.converged:
        findings.append(
            Finding(
                code="not_converged",
                detail=f"ICP was still moving after {registration.best.iterations} iterations",
                value=float(registration.best.iterations),
            )
        )
    closeness = 1.0 - fit.truncated_rms_mm / limit_mm
    confidence = max(0.0, min(1.0, fit.fitness * closeness * margin)) if matched else 0.0
    return Verdict(status="ok" if matched else "no_match", confidence=confidence, findings=findings)
