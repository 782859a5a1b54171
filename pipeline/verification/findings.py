"""The findings of a verdict: what it rests on, and what a person should know whatever the status."""

from pipeline.core.results import Finding, VerdictStatus
from pipeline.core.settings import RegistrationSettings
from pipeline.kernels.surface_patches import Patch
from pipeline.verification.evidence import Case
from pipeline.verification.thresholds import UNIT_FACTORS, VERDICT


def too_little(case: Case, settings: RegistrationSettings) -> list[Finding]:
    """Too little of the scan lies on the design, or shows it, for any pose; empty where it is enough."""
    fit, found = case.registration.fit, []
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
    return found


def other_part(case: Case, probability: float) -> list[Finding]:
    """The evidence says that the scan is of another part; empty where it does not."""
    if probability >= VERDICT.other_part:
        return []
    detail = (
        f"the scan is of this design with probability {probability:.2g}: it lies {case.rms_mm:.3g} mm off "
        f"(RMS), its normals agree to {case.surfaces.normal_agreement:.0%}, and it differs in shape by "
        f"{case.surfaces.detail_mm:.3g} mm (RMS over patches)"
    )
    return [Finding(code="other_part", detail=detail, value=probability)]


def high_residual(case: Case) -> list[Finding]:
    """The scan lies farther off than a scan of the part may for `ok`."""
    limit_mm, inlier_mm = case.quality.residual_limit_mm, case.registration.inlier_distance_mm
    if case.tight_fit.is_near:
        return []
    detail = (
        f"the scan is {case.rms_mm:.3g} mm off the design (RMS, each distance counted as at most "
        f"{inlier_mm:.3g} mm); the limit for ok is {limit_mm:.3g} mm"
    )
    return [Finding(code="high_residual", detail=detail, value=case.rms_mm)]


def differences(case: Case) -> list[Finding]:
    """Places where the shape of the scan and the design differ by more than noise and smooth distortion."""
    found = []
    patch = case.surfaces.scan_patch
    if patch is not None:
        area = f"a patch of {patch.area_mm2:.3g} mm^2 of the scan"
        depth = f"up to {abs(patch.peak):.3g} mm"
        rest = f"the design, at {_place(patch)}: more than noise and smooth distortion explain"
        if patch.mean < 0:
            detail = f"{area} lies {depth} inside {rest}"
            found.append(Finding(code="missing_material", detail=detail, value=patch.peak))
        else:
            detail = f"{area} lies {depth} off {rest}"
            found.append(Finding(code="local_difference", detail=detail, value=patch.peak))
    patch = case.surfaces.design_patch
    if patch is not None:
        detail = (
            f"a patch of {patch.area_mm2:.3g} mm^2 of the design lies up to {patch.peak:.3g} mm off the "
            f"scan, at {_place(patch)}: it is missing in the scan, or covered"
        )
        found.append(Finding(code="missing_material", detail=detail, value=patch.peak))
    patch = case.surfaces.through_patch
    if patch is not None and not found:
        detail = (
            f"a patch of {patch.area_mm2:.3g} mm^2 of the scan, at {_place(patch)}, lies behind material of "
            f"the design, {patch.peak:.3g} mm deep: that is missing in the scan"
        )
        found.append(Finding(code="missing_material", detail=detail, value=patch.peak))
    return found


def size_differences(case: Case) -> list[Finding]:
    """The scan is longer along one direction, or larger, than a print of the design."""
    strain, fit = case.strain, case.tight_fit
    if strain is None:
        return []
    found = []
    if fit.is_stretched:
        low, middle, high = strain.principal
        column, word = (2, "longer") if high - middle >= middle - low else (0, "shorter")
        axis = ", ".join(f"{x:.2f}" for x in strain.axes[:, column])
        detail = (
            f"the scan is {100 * strain.spread:.1f} % {word} than the design along ({axis}), compared with "
            f"another direction: more than a print and its scan explain, which leave {strain.left_mm:.2g} mm "
            "(RMS over patches) beside it; see scale.per_axis"
        )
        found.append(Finding(code="stretched", detail=detail, value=strain.spread))
    if fit.is_other_size:
        word = "larger" if strain.mean > 0 else "smaller"
        detail = (
            f"the scan is {100 * abs(strain.mean):.1f} % {word} than the design along all directions, more "
            "than a print shrinks: another size of the part, or a wrong scale; see scale.isotropic"
        )
        found.append(Finding(code="other_size", detail=detail, value=1.0 + strain.mean))
    return found


def flat_scan(case: Case) -> list[Finding]:
    """The scan is a flat piece: what holds it in its plane is its outline alone, which may be a cut."""
    thickness_mm = case.surfaces.thickness_mm
    if not case.tight_fit.is_flat:
        return []
    detail = (
        f"the scan is flat to {thickness_mm:.3g} mm (RMS): it fits on any flat of its size, and only edges "
        "and holes tell where; scan the part from another side too"
    )
    return [Finding(code="flat_scan", detail=detail, value=thickness_mm)]


def what_would_settle(case: Case) -> list[Finding]:
    """What would settle a verdict that is uncertain for want of evidence."""
    if case.quality.accuracy_mm is None:
        detail = (
            "state the accuracy of the scanner (options.scan_accuracy_mm), or scan the part from more sides: "
            "either may settle whether the scan is of this part"
        )
        return [Finding(code="accuracy_unknown", detail=detail, value=None)]
    if case.tight_fit.is_too_coarse:
        share = case.quality.accuracy_mm / case.diagonal_mm
        detail = (
            f"the stated accuracy of the scanner is {share:.1%} of the size of the design; a scanner with "
            f"less than {VERDICT.max_accuracy_share:.0%} is needed to vouch for the pose"
        )
        return [Finding(code="accuracy_too_coarse", detail=detail, value=share)]
    coverage = case.registration.design_coverage
    detail = (
        f"the scan shows {coverage:.0%} of the design, which is not enough to vouch for the pose: scan the "
        "part from another side"
    )
    return [Finding(code="scan_more", detail=detail, value=coverage)]


def not_calibrated(case: Case) -> list[Finding]:
    """The settings are none that the probabilities were fitted with."""
    if case.is_fitted:
        return []
    detail = (
        "confidence is null: its models were fitted with the default resample.enabled, landmarks, "
        "matching.length_share and registration.inlier_share"
    )
    return [Finding(code="confidence_not_calibrated", detail=detail, value=None)]


def _place(patch: Patch) -> str:
    return "(" + ", ".join(f"{x:.3g}" for x in patch.centre_mm) + ") mm in the design's frame"


def unit_factor(factor: float) -> Finding:
    """The scan is in another unit."""
    detail = (
        f"the scan fits only when its numbers are multiplied by {factor:.6g} ({UNIT_FACTORS[factor]}); "
        "transform and "
        "metrics refer to the scaled scan; set the unit in options.units and submit again"
    )
    return Finding(code="unit_factor", detail=detail, value=factor)


def other_unit(case: Case) -> list[Finding]:
    """In another unit the scan would lie on the design, but not as surely as `units_suspect` asks."""
    factor = case.checks.loose_unit_factor
    if factor is None:
        return []
    detail = (
        f"multiplied by {factor:.6g} ({UNIT_FACTORS[factor]}) the scan would lie on the design, but not as "
        "tightly as a scan of the part; if that is its unit, set it in options.units and submit again"
    )
    return [Finding(code="other_unit_fits", detail=detail, value=factor)]


def mirrored(case: Case, settings: RegistrationSettings) -> Finding | None:
    """The scan is the mirror image of the part: it fits far better than the scan itself, and as surely and
    tightly as `ok` asks; None where it does not.
    """
    check = case.checks.mirrored
    if check is None or check.same_part is None or check.pose is None or not check.is_tight:
        return None
    if check.same_part < VERDICT.ok_same_part or check.pose < VERDICT.ok_pose:
        return None
    if check.rms_mm > settings.mirror_gain * case.rms_mm:
        return None
    detail = (
        f"the mirror image of the scan lies {check.rms_mm:.3g} mm off the design (RMS), the scan itself "
        f"{case.rms_mm:.3g} mm: it was mirrored on export, or it is the opposite-hand part"
    )
    return Finding(code="mirrored", detail=detail, value=check.rms_mm)


def mirror_fits_better(case: Case, status: VerdictStatus) -> list[Finding]:
    """The mirror image fits better, but not by so much that the scan must be one."""
    check = case.checks.mirrored
    if check is None or status == "mirrored" or not case.mirror_fits_better():
        return []
    detail = (
        f"the mirror image of the scan lies {check.rms_mm:.3g} mm off the design (RMS), the scan itself "
        f"{case.rms_mm:.3g} mm: it may be the opposite-hand part"
    )
    return [Finding(code="mirror_fits_better", detail=detail, value=check.rms_mm)]


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
        other = "1 other pose is" if equal == 1 else f"{equal} other poses are"
        detail = f"{other} equivalent to this one by a symmetry of the design; see symmetry"
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
