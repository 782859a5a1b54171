"""The findings of a verdict: what it rests on, and what a person should know whatever the status."""

from pipeline.core.results import Finding, VerdictStatus
from pipeline.core.settings import RegistrationSettings
from pipeline.verification.evidence import Case
from pipeline.verification.thresholds import UNIT_FACTORS, VERDICT


def misfit(case: Case, settings: RegistrationSettings) -> list[Finding]:
    """Why the scan does not fit the design under the best pose; empty where it does."""
    fit, found = case.registration.fit, []
    limit_mm = settings.max_residual_share * case.diagonal_mm
    inlier_mm = case.registration.inlier_distance_mm
    if fit.fitness < settings.min_fitness:
        near = f"{fit.fitness:.0%} of the scan lies within {inlier_mm:.3g} mm of the design"
        detail = f"{near}; at least {settings.min_fitness:.0%} is required"
        found.append(Finding(code="low_fitness", detail=detail, value=fit.fitness))
    coverage = case.registration.design_coverage
    if coverage < settings.min_coverage:
        detail = (
            f"the scan covers {coverage:.1%} of the design; at least {settings.min_coverage:.0%} is required"
        )
        found.append(Finding(code="low_coverage", detail=detail, value=coverage))
    if fit.truncated_rms_mm > limit_mm:
        detail = (
            f"the scan is {fit.truncated_rms_mm:.3g} mm off the design (RMS, each distance counted as at "
            "most "
            f"{inlier_mm:.3g} mm); the limit for the same part is {limit_mm:.3g} mm"
        )
        found.append(Finding(code="high_residual", detail=detail, value=fit.truncated_rms_mm))
    return found


def unit_factor(factor: float) -> Finding:
    """The scan is in another unit."""
    detail = (
        f"the scan fits only when its numbers are multiplied by {factor:.6g} ({UNIT_FACTORS[factor]}); "
        "transform and "
        "metrics refer to the scaled scan; set the unit in options.units and submit again"
    )
    return Finding(code="unit_factor", detail=detail, value=factor)


def mirrored(case: Case, settings: RegistrationSettings) -> Finding | None:
    """The scan is the mirror image of the part; None where it is not."""
    mirrored_mm = case.checks.mirrored_rms_mm
    limit_mm = settings.max_residual_share * case.diagonal_mm
    if mirrored_mm is None or mirrored_mm > limit_mm or mirrored_mm > settings.mirror_gain * case.rms_mm:
        return None
    detail = (
        f"the mirror image of the scan lies {mirrored_mm:.3g} mm off the design (RMS), the scan itself "
        f"{case.rms_mm:.3g} mm: it was mirrored on export, or it is the opposite-hand part"
    )
    return Finding(code="mirrored", detail=detail, value=mirrored_mm)


def mirror_fits_better(case: Case, status: VerdictStatus) -> list[Finding]:
    """The mirror image fits better, but not by so much that the scan must be one."""
    mirrored_mm = case.checks.mirrored_rms_mm
    if mirrored_mm is None or status == "mirrored" or not case.mirror_fits_better():
        return []
    detail = (
        f"the mirror image of the scan lies {mirrored_mm:.3g} mm off the design (RMS), the scan itself "
        f"{case.rms_mm:.3g} mm: it may be the opposite-hand part"
    )
    return [Finding(code="mirror_fits_better", detail=detail, value=mirrored_mm)]


def loose_fit(case: Case, settings: RegistrationSettings) -> list[Finding]:
    """The scan lies farther off than a good scanner and printer leave it."""
    if not case.is_loose(settings):
        return []
    detail = (
        f"the scan is {case.rms_mm:.3g} mm off the design (RMS), more than expected of a good scanner and "
        "printer: "
        "a rough scan, or a similar part; inspect the aligned meshes"
    )
    return [Finding(code="loose_fit", detail=detail, value=case.rms_mm)]


def unconstrained_motions(case: Case) -> list[Finding]:
    """One finding for each motion that the scan does not determine."""
    return [
        Finding(
            code="free_motion",
            detail=f"the {motion.kind} about or along ({', '.join(f'{x:.3f}' for x in motion.axis)}) is "
            f"uncertain by {motion.sigma_mm:.3g} mm (1 sigma); the limit is {case.max_sigma_mm:.3g} mm",
            value=motion.sigma_mm,
        )
        for motion in case.registration.observability.unconstrained
    ]


def alternatives(case: Case) -> list[Finding]:
    """Equivalent poses by symmetry, and other poses that fit almost as well."""
    found = []
    equal = sum(case.checks.symmetric)
    if equal:
        detail = f"{equal} of the alternatives are equivalent to this pose by a symmetry of the design"
        found.append(Finding(code="symmetric_design", detail=detail, value=float(equal)))
    ratios = case.alternative_ratios()
    if ratios and ratios[0] < VERDICT.alternative_note_ratio:
        detail = "another pose, not equivalent by symmetry, fits almost as well; see alternatives"
        found.append(Finding(code="rival_pose", detail=detail, value=ratios[0]))
    return found


def weaknesses(case: Case) -> list[Finding]:
    """Weak geometry, few landmark matches, ICP that did not converge."""
    found, registration = [], case.registration
    weakest = float(registration.observability.eigenvalues[0])
    if weakest < VERDICT.weak_eigenvalue and not registration.observability.unconstrained:
        detail = "the surfaces constrain one of the six degrees of freedom only weakly; check the pose"
        found.append(Finding(code="weakly_constrained", detail=detail, value=weakest))
    if case.matching.T_landmarks is None:
        count = len(case.matching.design)
        detail = (
            f"{count} landmarks match, too few to determine a pose by landmarks alone; the pose comes from "
            f"hypotheses of source {registration.source}"
        )
        found.append(Finding(code="few_landmarks", detail=detail, value=float(count)))
    if not registration.best.converged:
        iterations = registration.best.iterations
        detail = f"ICP had not converged after {iterations} iterations"
        found.append(Finding(code="not_converged", detail=detail, value=float(iterations)))
    return found
