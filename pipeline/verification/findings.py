"""The findings of a verdict: what it rests on, and what a person should know whatever the status."""

from pipeline.core.results import Finding, VerdictStatus
from pipeline.core.sentences import place, sentence
from pipeline.core.settings import RegistrationSettings
from pipeline.kernels.surface_patches import Patch
from pipeline.verification.evidence import Case
from pipeline.verification.thresholds import UNIT_FACTORS, VERDICT

#: Smaller ones are not written out.
MIN_SHOWN_PROBABILITY = 0.001
#: Kinds of motion, and the sources of hypotheses, for people.
MOTIONS = {
    "rotation": "rotation about",
    "translation": "translation along",
    "screw": "screw motion about",
}
SOURCES = {
    "landmarks": "pairs of landmarks",
    "dense": "evenly distributed points",
    "axes": "the principal axes",
}


def too_little(case: Case, settings: RegistrationSettings) -> list[Finding]:
    """Too little of the scan lies on the design, or shows it, for any pose; empty where it is enough."""
    fit, found = case.registration.fit, []
    inlier_mm = case.registration.inlier_distance_mm
    if fit.fitness < settings.min_fitness:
        detail = sentence(
            "only {share:.1%} of the scan lies within {distance:.3g} mm of the design; at least "
            "{required:.1%} is required: check that it is this part, and remove supports and background "
            "from the scan",
            share=fit.fitness,
            distance=inlier_mm,
            required=settings.min_fitness,
        )
        found.append(Finding(code="low_fitness", detail=detail, value=fit.fitness))
    coverage = case.registration.design_coverage
    if coverage < settings.min_coverage:
        detail = sentence(
            "the scan shows only {share:.1%} of the design; at least {required:.1%} is required: scan "
            "more of the part",
            share=coverage,
            required=settings.min_coverage,
        )
        found.append(Finding(code="low_coverage", detail=detail, value=coverage))
    return found


def other_part(case: Case, probability: float) -> list[Finding]:
    """The evidence says that the scan is of another part; empty where it does not."""
    if probability >= VERDICT.other_part:
        return []
    detail = sentence(
        "the scan is probably of another part (probability of this one: {probability}): it lies "
        "{rms:.3g} mm off the design (RMS), its normals agree with the design's to {agreement:.0%} "
        "(mean cosine), and its shape differs by {shape:.3g} mm (RMS over patches); verdict.evidence "
        "lists all that counts",
        probability=_probability(probability),
        rms=case.rms_mm,
        agreement=case.surfaces.normal_agreement,
        shape=case.surfaces.detail_mm,
    )
    return [Finding(code="other_part", detail=detail, value=probability)]


def high_residual(case: Case) -> list[Finding]:
    """The scan lies farther off than a scan of the part may for `ok`."""
    limit_mm, inlier_mm = case.quality.residual_limit_mm, case.registration.inlier_distance_mm
    if case.tight_fit.is_near:
        return []
    detail = sentence(
        "the scan lies {rms:.3g} mm off the design (RMS, each distance counted as at most "
        "{distance:.3g} mm); the limit for ok is {limit:.3g} mm: an inaccurate scan, or a part that "
        "differs from the design",
        rms=case.rms_mm,
        distance=inlier_mm,
        limit=limit_mm,
    )
    return [Finding(code="high_residual", detail=detail, value=case.rms_mm)]


def differences(case: Case) -> list[Finding]:
    """Places where the shape of the scan and the design differ by more than noise and smooth distortion."""
    found = []
    patch = case.surfaces.scan_patch
    if patch is not None and patch.mean < 0:
        detail = sentence(
            "at {place} mm in the frame of the design, {area:.3g} mm² of the scan lie up to {depth:.3g} "
            "mm inside the design, more than noise and smooth distortion explain: check whether "
            "material is missing there",
            **_measures(patch),
        )
        found.append(Finding(code="missing_material", detail=detail, value=patch.peak))
    elif patch is not None:
        detail = sentence(
            "at {place} mm in the frame of the design, {area:.3g} mm² of the scan lie up to {depth:.3g} "
            "mm off the design, more than noise and smooth distortion explain: check for excess "
            "material, supports or another version of the part",
            **_measures(patch),
        )
        found.append(Finding(code="local_difference", detail=detail, value=patch.peak))
    patch = case.surfaces.design_patch
    if patch is not None:
        detail = sentence(
            "at {place} mm in the frame of the design, {area:.3g} mm² of the design lie up to "
            "{depth:.3g} mm from the scan, which should show them: check whether material is missing "
            "there, or a hole was filled in the scan",
            **_measures(patch),
        )
        found.append(Finding(code="missing_material", detail=detail, value=patch.peak))
    patch = case.surfaces.through_patch
    if patch is not None and not found:
        detail = sentence(
            "at {place} mm in the frame of the design, the scan shows {area:.3g} mm² that {depth:.3g} "
            "mm of material of the design would hide: check whether this material is missing in the part",
            **_measures(patch),
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
        is_longer = high - middle >= middle - low
        detail = sentence(
            "compared with the design, the scan is {share:.1%} {longer} along {axis} than along "
            "{other}, more than printing and scanning explain; apart from that the shapes differ by "
            "{left:.2g} mm (RMS over patches): check that it is this version of the part, and see "
            "scale.per_axis",
            share=strain.spread,
            longer="longer" if is_longer else "shorter",
            axis=place(strain.axes[:, 2 if is_longer else 0]),
            other=place(strain.axes[:, 0 if is_longer else 2]),
            left=strain.left_mm,
        )
        found.append(Finding(code="stretched", detail=detail, value=strain.spread))
    if fit.is_other_size:
        detail = sentence(
            "the scan is {share:.1%} {larger} than the design in all directions, more than printing and "
            "scanning explain: another size of the part, or a wrong scale of the printer, the scanner "
            "or the file; see scale.isotropic",
            share=abs(strain.mean),
            larger="larger" if strain.mean > 0 else "smaller",
        )
        found.append(Finding(code="other_size", detail=detail, value=1.0 + strain.mean))
    return found


def flat_scan(case: Case) -> list[Finding]:
    """The scan is a flat piece: what holds it in its plane is its outline alone, which may be a cut."""
    thickness_mm = case.surfaces.thickness_mm
    if not case.tight_fit.is_flat:
        return []
    detail = sentence(
        "the scan is a flat piece ({thickness:.3g} mm RMS from a plane): it fits anywhere on a flat "
        "face of the design, and only its outline and its holes tell where; scan the part from another "
        "side too",
        thickness=thickness_mm,
    )
    return [Finding(code="flat_scan", detail=detail, value=thickness_mm)]


def what_would_settle(case: Case) -> list[Finding]:
    """What would settle a verdict that is uncertain for want of evidence."""
    if case.quality.accuracy_mm is None:
        detail = sentence(
            "the evidence is not enough for ok, and the accuracy of the scanner was not stated: state "
            "it (options.scan_accuracy_mm), or scan the part from more sides; either may decide"
        )
        return [Finding(code="accuracy_unknown", detail=detail, value=None)]
    if case.tight_fit.is_too_coarse:
        share = case.quality.accuracy_mm / case.diagonal_mm
        detail = sentence(
            "the stated accuracy of the scanner, {accuracy:.3g} mm, is {share:.1%} of the diagonal of "
            "the design; a pose is confirmed up to {limit:.1%} only: use a more accurate scanner, or "
            "check the pose",
            accuracy=case.quality.accuracy_mm,
            share=share,
            limit=VERDICT.max_accuracy_share,
        )
        return [Finding(code="accuracy_too_coarse", detail=detail, value=share)]
    coverage = case.registration.design_coverage
    detail = sentence(
        "the evidence is not enough for ok, although the accuracy of the scanner is stated; the scan "
        "shows {share:.0%} of the design: scan more sides if some are missing, else check that it is "
        "this part",
        share=coverage,
    )
    return [Finding(code="scan_more", detail=detail, value=coverage)]


def not_calibrated(case: Case) -> list[Finding]:
    """The settings are none that the probabilities were fitted with."""
    if case.is_fitted:
        return []
    detail = sentence(
        "no confidence is given: it holds for the default values of resample.enabled, landmarks, "
        "matching.length_share and registration.inlier_share only, and the settings of this job change "
        "one of them"
    )
    return [Finding(code="confidence_not_calibrated", detail=detail, value=None)]


def _probability(value: float) -> str:
    """`3.1 %`, or `less than 0.1 %`"""
    if value < MIN_SHOWN_PROBABILITY:
        return sentence("less than {share:.1%}", share=MIN_SHOWN_PROBABILITY)
    return sentence("{value:.1%}", value=value)


def _measures(patch: Patch) -> dict[str, object]:
    return {"area": patch.area_mm2, "depth": abs(patch.peak), "place": place(patch.centre_mm, 1)}


def unit_factor(factor: float) -> Finding:
    """The scan is in another unit."""
    detail = sentence(
        "the scan fits only when its numbers are multiplied by {factor:.6g} ({units}); transform and metrics "
        "refer to the scaled scan; set the unit in options.units and submit again",
        factor=factor,
        units=UNIT_FACTORS[factor],
    )
    return Finding(code="unit_factor", detail=detail, value=factor)


def other_unit(case: Case) -> list[Finding]:
    """In another unit the scan would lie on the design, but not as surely as `units_suspect` asks."""
    factor = case.checks.loose_unit_factor
    if factor is None:
        return []
    detail = sentence(
        "multiplied by {factor:.6g} ({units}) the scan would lie on the design, but not as closely as a scan "
        "of the part; if that is its unit, set it in options.units and submit again",
        factor=factor,
        units=UNIT_FACTORS[factor],
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
    detail = sentence(
        "the mirror image of the scan lies {mirrored:.3g} mm off the design (RMS), the scan itself "
        "{rms:.3g} mm: it was mirrored on export, or it is the opposite-hand part",
        mirrored=check.rms_mm,
        rms=case.rms_mm,
    )
    return Finding(code="mirrored", detail=detail, value=check.rms_mm)


def mirror_fits_better(case: Case, status: VerdictStatus) -> list[Finding]:
    """The mirror image fits better, but not by so much that the scan must be one."""
    check = case.checks.mirrored
    if check is None or status == "mirrored" or not case.mirror_fits_better():
        return []
    detail = sentence(
        "the mirror image of the scan lies {mirrored:.3g} mm off the design (RMS), the scan itself "
        "{rms:.3g} mm: it may be the opposite-hand part; check which hand it is",
        mirrored=check.rms_mm,
        rms=case.rms_mm,
    )
    return [Finding(code="mirror_fits_better", detail=detail, value=check.rms_mm)]


def loose_fit(case: Case, settings: RegistrationSettings) -> list[Finding]:
    """The scan lies farther off than a good scanner and printer leave it."""
    if not case.is_loose(settings):
        return []
    detail = sentence(
        "the scan lies {rms:.3g} mm off the design (RMS), more than expected of a good scanner and printer: "
        "a rough scan, or a similar part; inspect the aligned meshes",
        rms=case.rms_mm,
    )
    return [Finding(code="loose_fit", detail=detail, value=case.rms_mm)]


def unconstrained_motions(case: Case) -> list[Finding]:
    """One finding for each motion that the scan does not determine."""
    return [
        Finding(
            code="free_motion",
            detail=sentence(
                "the {motion} {axis} is uncertain by {sigma:.3g} mm (1 sigma, RMS displacement of the "
                "scan); the limit is {limit:.3g} mm: scan more of the part, or accept it",
                motion=MOTIONS[motion.kind],
                axis=place(motion.axis, 3),
                sigma=motion.sigma_mm,
                limit=case.max_sigma_mm,
            ),
            value=motion.sigma_mm,
        )
        for motion in case.registration.observability.unconstrained
    ]


def alternatives(case: Case) -> list[Finding]:
    """Equivalent poses by symmetry, and other poses that fit almost as well."""
    found = []
    equal = sum(case.checks.symmetric)
    if equal:
        detail = sentence(
            "the design is symmetric, so this pose has equivalents that fit as well (number: {count}); "
            "alternatives has them as one row",
            count=equal,
        )
        found.append(Finding(code="symmetric_design", detail=detail, value=float(equal)))
    ratios = case.alternative_ratios()
    if ratios and ratios[0] < VERDICT.alternative_note_ratio:
        detail = sentence(
            "another pose, no symmetry of the design, has a score of {ratio:.2f}, where "
            "the best has 1 and higher is worse; compare the poses in alternatives",
            ratio=ratios[0],
        )
        found.append(Finding(code="rival_pose", detail=detail, value=ratios[0]))
    return found


def weaknesses(case: Case) -> list[Finding]:
    """Weak geometry, few landmark matches, ICP that did not converge."""
    found, registration = [], case.registration
    weakest = float(registration.observability.eigenvalues[0])
    if weakest < VERDICT.weak_eigenvalue and not registration.observability.unconstrained:
        detail = sentence(
            "one motion of the scan is within its limit of uncertainty, but changes the fit very "
            "little: check the pose, and see observability"
        )
        found.append(Finding(code="weakly_constrained", detail=detail, value=weakest))
    if case.matching.T_landmarks is None:
        count = len(case.matching.design)
        detail = sentence(
            "too few landmarks match ({count}) for a pose from landmarks alone, so rmse_landmarks_mm "
            "and k_ratio are null; the pose comes from {source}",
            count=count,
            source=SOURCES[registration.source],
        )
        found.append(Finding(code="few_landmarks", detail=detail, value=float(count)))
    if not registration.best.converged:
        iterations = registration.best.iterations
        detail = sentence(
            "ICP was still moving the scan after {count} iterations: raise "
            "registration.max_iterations, and check the pose",
            count=iterations,
        )
        found.append(Finding(code="not_converged", detail=detail, value=float(iterations)))
    return found
