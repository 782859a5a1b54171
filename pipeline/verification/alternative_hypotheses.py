"""Alternative hypotheses: what could make the best pose wrong. Another unit, a mirror image, an equivalent
pose.

Each is tested only where the first fit gives cause, and by evidence on the surfaces alone.
"""

import numpy as np

from pipeline.analysis.design_model import DesignModel
from pipeline.analysis.mesh_analysis import Analysis, analyse_mesh
from pipeline.analysis.scan_registration import (
    RegisteredScan,
    match_scan,
    match_to_design,
    register_scan,
)
from pipeline.core.errors import PipelineError
from pipeline.core.job_parameters import JobParameters
from pipeline.core.mesh import FloatArray, Mesh
from pipeline.core.settings import RegistrationSettings
from pipeline.core.timing import silent
from pipeline.search.pose_search import search_pose
from pipeline.search.scan_model import ScanModel
from pipeline.search.score_ratio import SCORE_LIMITS, score_ratio
from pipeline.stages.matching import match_landmarks
from pipeline.stages.registration import Registration, evaluate_fit
from pipeline.verification.equivalent_poses import add_equivalent_poses
from pipeline.verification.evidence import (
    Case,
    log_coverage,
    probability,
    rival_values,
    same_part,
    surface_values,
)
from pipeline.verification.hypothesis_checks import HypothesisChecks, MirrorCheck
from pipeline.verification.placed_scan import PlacedScan
from pipeline.verification.repeats import repeats_of_design
from pipeline.verification.scan_quality import ScannerQuality
from pipeline.verification.size_evidence import assess_size
from pipeline.verification.surface_evidence import assess_surfaces
from pipeline.verification.thresholds import CONFIDENCE, HYPOTHESES, UNIT_FACTORS, VERDICT
from pipeline.verification.tight_fit import TightFit
from pipeline.verification.unreflected import register_unreflected


def fits(registration: Registration, quality: ScannerQuality, settings: RegistrationSettings) -> bool:
    """Whether enough of the scan lies near enough to the design."""
    fit = registration.fit
    is_enough = fit.fitness >= settings.min_fitness and registration.design_coverage >= settings.min_coverage
    return is_enough and fit.truncated_rms_mm <= quality.residual_limit_mm


def verify_hypotheses(
    registered: RegisteredScan, quality: ScannerQuality, design: DesignModel, job: JobParameters
) -> tuple[RegisteredScan, HypothesisChecks]:
    """Another unit where the scan does not fit, the mirror image where it fits loosely, and equivalent poses.

    Returns
    -------
    The scan under the hypothesis that holds (in another unit, or from a better equivalent pose), and the
    checks.
    """
    settings = job.settings.registration
    unit_factor = loose_factor = mirrored = None
    if not fits(registered.registration, quality, settings):
        rescaled, loose_factor = check_other_units(registered.scan, quality, design, job)
        if rescaled is not None:
            unit_factor, registered = rescaled
    rms_mm = registered.registration.fit.truncated_rms_mm
    if unit_factor is None and rms_mm > settings.mirror_share * design.diagonal_mm:
        mirrored, T_design_mirrored = check_mirror_image(registered, quality, design, job)
        if mirrored.same_part is not None:
            registered = register_unreflected(registered, T_design_mirrored, design, job)
    registered, symmetric = add_equivalent_poses(registered, design, job)
    repeats = tuple(bool(each) for each in repeats_of_design(registered, design, job.seed))
    return registered, HypothesisChecks(unit_factor, mirrored, symmetric, loose_factor, repeats)


def check_other_units(
    scan: Analysis, quality: ScannerQuality, design: DesignModel, job: JobParameters
) -> tuple[tuple[float, RegisteredScan] | None, float | None]:
    """The unit factor under which the scan fits the design as `ok` asks, nearest in size first, or None; and
    one under which it lies on the design, but not so tightly, where there is none that does.
    """
    diagonal_mm, settings = design.diagonal_mm, job.settings.registration
    ratio = scan.mesh.diagonal_mm / diagonal_mm
    loose_factor: float | None = None
    likely = [
        factor
        for factor in UNIT_FACTORS
        if HYPOTHESES.min_size_ratio <= ratio * factor <= HYPOTHESES.max_size_ratio
    ]
    for factor in sorted(likely, key=lambda each: abs(np.log(ratio * each))):
        scaled = Mesh(scan.mesh.vertices * factor, scan.mesh.faces)
        try:
            analysis = analyse_mesh(
                *(scaled, "scan", design.scales, job.settings, silent(), job.seed),
                stations=None if scan.stations is None else scan.stations.scaled(factor),
            )
        except PipelineError:  # a hypothetical scan that cannot be analysed is no error of the job
            continue
        registered = register_scan(match_scan(analysis, design, job), design, job)
        # A small scan fits nearly anywhere: it must fit tightly for its own size too, and be constrained.
        size_mm = min(diagonal_mm, scaled.diagonal_mm)
        tight_mm = SCORE_LIMITS.loose_fit_share * settings.max_residual_share * size_mm
        is_tight = registered.registration.fit.truncated_rms_mm <= tight_mm
        is_whole = scaled.diagonal_mm >= HYPOTHESES.whole_part_ratio * diagonal_mm
        is_held = is_whole or not registered.registration.observability.unconstrained
        if not (is_tight and is_held and fits(registered.registration, quality, settings)):
            continue
        no_symmetry = (False,) * len(registered.registration.alternatives)
        checks = HypothesisChecks(factor, None, no_symmetry)
        case = Case.of(registered, checks, quality, design, job)
        part = same_part(case)
        if part >= VERDICT.ok_same_part and case.tight_fit.holds():
            return (factor, registered), None
        if loose_factor is None and part >= VERDICT.other_part:
            loose_factor = factor
    return None, loose_factor


def check_mirror_image(
    registered: RegisteredScan, quality: ScannerQuality, design: DesignModel, job: JobParameters
) -> tuple[MirrorCheck, FloatArray]:
    """How well the mirrored scan fits under its best pose, and that pose (4, 4), `T_design_mirrored`."""
    settings, registration, scan = job.settings, registered.registration, registered.scan
    described = registered.described.mirrored()
    matching = match_to_design(described, design, job)
    model = ScanModel.mirrored(
        scan.mesh, registration.scan_surface, settings.registration, job.seed, scan.stations
    )
    search = search_pose(model, design.surface, matching, settings.registration, thorough=False)
    inlier_mm, best = registration.inlier_distance_mm, search.best
    by_samples_mm = float(np.sqrt(best.cost_mm2))
    gain_mm = settings.registration.mirror_gain * registration.fit.truncated_rms_mm
    limit_mm = max(gain_mm, VERDICT.mirror_better_ratio * registration.fit.truncated_rms_mm)
    if by_samples_mm > HYPOTHESES.mirror_sample_margin * limit_mm:  # no need to look at every vertex
        return MirrorCheck(by_samples_mm), best.T_design_scan
    fit = evaluate_fit(model.mesh, model.mesh.weights(), design.surface, best.T_design_scan, inlier_mm)
    rms_mm, of_scan_mm = fit.truncated_rms_mm, registration.fit.truncated_rms_mm
    if rms_mm > limit_mm:
        return MirrorCheck(rms_mm), best.T_design_scan
    placed = PlacedScan(
        model.mesh,
        fit,
        best.normal_sign,
        described.mesh,
        scan.resampled.working_of_clean,
        registration.scan_surface,
        is_mirrored=True,
    )
    working_design, accuracy_mm = design.analysis.resampled.mesh, quality.accuracy_mm or 0.0
    surfaces = assess_surfaces(placed, design.surface, working_design, inlier_mm, accuracy_mm)
    under = match_landmarks(
        design.described.landmarks,
        described.landmarks,
        matching.hypotheses,
        best.T_design_scan,
        design.matching_mm,
    )
    ratios = [score_ratio(pose.score_mm2, best.score_mm2, design.diagonal_mm) for pose in search.alternatives]
    if rms_mm > gain_mm:
        return MirrorCheck(rms_mm, detail_mm=surfaces.detail_mm), best.T_design_scan
    values = surface_values(rms_mm, surfaces, quality, design.diagonal_mm)
    values |= rival_values(
        ratios, ratios, of_scan_mm, rms_mm, len(under.scan), len(described.landmarks.vertex)
    )
    values["coverage"] = log_coverage(best.coverage)
    part, pose = (probability(model, values) for model in (CONFIDENCE.same_part, CONFIDENCE.pose))
    strain = assess_size(model.mesh, fit, design.surface, inlier_mm, job.seed)
    tight = TightFit(rms_mm, surfaces, strain, quality, design.diagonal_mm)
    return MirrorCheck(rms_mm, surfaces.detail_mm, part, pose, tight.holds()), best.T_design_scan
