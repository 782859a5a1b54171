"""Alternative hypotheses: what could make the best pose wrong. Another unit, a mirror image, an equivalent
pose.

Each is tested only where the first fit gives cause, and by evidence on the surfaces alone.
"""

from dataclasses import dataclass

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
from pipeline.core.mesh import Mesh
from pipeline.core.settings import RegistrationSettings
from pipeline.core.timing import silent
from pipeline.search.pose_search import search_pose
from pipeline.search.scan_model import ScanModel
from pipeline.search.score_ratio import SCORE_LIMITS
from pipeline.stages.registration import Registration, evaluate_fit
from pipeline.verification.equivalent_poses import add_equivalent_poses
from pipeline.verification.thresholds import HYPOTHESES, UNIT_FACTORS


@dataclass(frozen=True, slots=True)
class HypothesisChecks:
    """unit_factor : the only one under which the scan fits, None for mm; mirrored_rms_mm : truncated RMS of
    the mirrored scan under its best pose, None where that was not tested; symmetric : for each alternative
    pose whether it is equivalent by a symmetry of the design
    """

    unit_factor: float | None
    mirrored_rms_mm: float | None
    symmetric: tuple[bool, ...]


def fits(registration: Registration, diagonal_mm: float, settings: RegistrationSettings) -> bool:
    """Whether enough of the scan lies near enough to the design."""
    fit = registration.fit
    is_enough = fit.fitness >= settings.min_fitness and registration.design_coverage >= settings.min_coverage
    return is_enough and fit.truncated_rms_mm <= settings.max_residual_share * diagonal_mm


def verify_hypotheses(
    registered: RegisteredScan, design: DesignModel, job: JobParameters
) -> tuple[RegisteredScan, HypothesisChecks]:
    """Another unit where the scan does not fit, the mirror image where it fits loosely, and equivalent poses.

    Returns
    -------
    The scan under the hypothesis that holds (in another unit, or from a better equivalent pose), and the
    checks.
    """
    diagonal_mm, settings = design.diagonal_mm, job.settings.registration
    unit_factor = mirrored = None
    if not fits(registered.registration, diagonal_mm, settings):
        rescaled = check_other_units(registered.scan, design, job)
        if rescaled is not None:
            unit_factor, registered = rescaled
    rms_mm = registered.registration.fit.truncated_rms_mm
    if unit_factor is None and rms_mm > settings.mirror_share * diagonal_mm:
        mirrored = check_mirror_image(registered, design, job)
    if unit_factor is None and not fits(registered.registration, diagonal_mm, settings):
        no_symmetry = (False,) * len(registered.registration.alternatives)
        return registered, HypothesisChecks(unit_factor, mirrored, no_symmetry)
    registered, symmetric = add_equivalent_poses(registered, design, job)
    return registered, HypothesisChecks(unit_factor, mirrored, symmetric)


def check_other_units(
    scan: Analysis, design: DesignModel, job: JobParameters
) -> tuple[float, RegisteredScan] | None:
    """The unit factor under which the scan fits the design, nearest in size first, or None."""
    diagonal_mm, settings = design.diagonal_mm, job.settings.registration
    ratio = scan.mesh.diagonal_mm / diagonal_mm
    likely = [
        factor
        for factor in UNIT_FACTORS
        if HYPOTHESES.min_size_ratio <= ratio * factor <= HYPOTHESES.max_size_ratio
    ]
    for factor in sorted(likely, key=lambda each: abs(np.log(ratio * each))):
        scaled = Mesh(scan.mesh.vertices * factor, scan.mesh.faces)
        try:
            analysis = analyse_mesh(scaled, "scan", design.scales, job.settings, silent(), job.seed)
        except PipelineError:  # a hypothetical scan that cannot be analysed is no error of the job
            continue
        registered = register_scan(match_scan(analysis, design, job), design, job)
        # A small scan fits nearly anywhere: it must fit tightly for its own size too, and be constrained.
        size_mm = min(diagonal_mm, scaled.diagonal_mm)
        tight_mm = SCORE_LIMITS.loose_fit_share * settings.max_residual_share * size_mm
        is_tight = registered.registration.fit.truncated_rms_mm <= tight_mm
        is_whole = scaled.diagonal_mm >= HYPOTHESES.whole_part_ratio * diagonal_mm
        is_held = is_whole or not registered.registration.observability.unconstrained
        if is_tight and is_held and fits(registered.registration, diagonal_mm, settings):
            return factor, registered
    return None


def check_mirror_image(registered: RegisteredScan, design: DesignModel, job: JobParameters) -> float:
    """Truncated RMS distance (mm) of the mirrored scan under its best pose."""
    settings = job.settings
    described = registered.described.mirrored(design.matching_mm, settings.matching)
    matching = match_to_design(described, design, job)
    surface = registered.registration.scan_surface
    model = ScanModel.mirrored(registered.scan.mesh, surface, settings.registration, job.seed)
    mesh = model.mesh
    best = search_pose(model, design.surface, matching, settings.registration, thorough=False).best
    inlier_mm = registered.registration.inlier_distance_mm
    return evaluate_fit(mesh, mesh.weights(), design.surface, best.T_design_scan, inlier_mm).truncated_rms_mm
