"""From a registration to the records of the results: each function builds one part of
`RegistrationResult`.
"""

import numpy as np
from scipy.spatial.transform import Rotation

from pipeline.core.job_parameters import JobParameters
from pipeline.core.landmark_set import LandmarkSet
from pipeline.core.mesh import FloatArray
from pipeline.core.results import (
    FreeMotion,
    Inputs,
    Landmarks,
    Match,
    Metrics,
    Note,
    Observability,
    RegistrationResult,
    Scale,
    ScaleFactor,
    ScanQuality,
    SegmentsPair,
    Transform,
)
from pipeline.kernels import rigid
from pipeline.kernels.visibility import MAX_HIDDEN_OF_RIGHT
from pipeline.search.types import Matching
from pipeline.stages.load import Loaded
from pipeline.stages.registration import Registration
from pipeline.stages.scale import ScaleDiagnosis
from pipeline.verification.scan_quality import ScannerQuality
from pipeline.workflows.alternative_records import alternative_records, symmetry_record
from pipeline.workflows.mesh_records import analysis_segments, landmark_records, landmark_warnings
from pipeline.workflows.provenance import provenance
from pipeline.workflows.registration_outcome import RegistrationOutcome


def registration_result(outcome: RegistrationOutcome, job: JobParameters) -> RegistrationResult:
    """The result without files and timings, which `publish` adds."""
    design, registered, checks = outcome.design, outcome.registered, outcome.checks
    registration, scan, has_pose = registered.registration, registered.scan, outcome.has_pose
    T_design_scan, cached = registration.best.T_design_scan, design.cached
    landmarks = Landmarks(
        design=landmark_records(design.analysis),
        scan=landmark_records(scan),
        matches=matches(registration.matching, design.analysis.landmarks, scan.landmarks, T_design_scan)
        if has_pose
        else [],
    )
    return RegistrationResult(
        verdict=outcome.verdict,
        transform=transform(
            outcome.aligned.registration.fit.T_design_scan,
            *(cached.input.mm_per_unit, outcome.input_scan.loaded, checks.unit_factor),
        )
        if has_pose
        else None,
        alignment=outcome.aligned.record,
        alternatives=alternative_records(outcome.alternatives, registration.best, design.diagonal_mm),
        symmetry=symmetry_record(registration, checks) if has_pose else None,
        metrics=metrics(registration, has_pose=has_pose),
        landmarks=landmarks,
        segments=SegmentsPair(
            design=analysis_segments(design.analysis, job.settings, design.cached.brep),
            scan=analysis_segments(scan, job.settings),
        ),
        deviation=outcome.deviations.summary if has_pose else None,
        deviation_of_design=outcome.of_design,
        inspection=outcome.inspection,
        reference=job.reference,
        observability=observability(registration) if has_pose else None,
        scale=None if outcome.scale is None else scale(outcome.scale, checks.unit_factor),
        scan=scan_quality(outcome.quality, outcome.input_scan.left_out_share),
        provenance=provenance(
            Inputs(design=cached.input, scan=outcome.input_scan.record()), job.settings, job.seed
        ),
        timings_s={},
        files=[],
        warnings=[
            *design.analysis.warnings,
            *scan.warnings,
            *landmark_warnings(design=landmarks.design, scan=landmarks.scan),
            *cached.warnings,
            *outcome.input_scan.warnings(),
            *(_ignored_stations(registration) if has_pose else []),
        ],
    )


def _ignored_stations(registration: Registration) -> list[Note]:
    if not registration.ignored_stations:
        return []
    detail = (
        "scan: the file says where the scanner stood, but under every pose that was found the part hides "
        f"more than {100 * MAX_HIDDEN_OF_RIGHT:.0f} % of the points from there; it was not used. Merged "
        "scans that are stored as one may say so"
    )
    return [Note(code="stations_ignored", detail=detail)]


def transform(
    T_design_scan: FloatArray, design_mm_per_unit: float, scan: Loaded, unit_factor: float | None = None
) -> Transform:
    """unit_factor : of a `units_suspect` scan; `matrix` is of the scan so scaled, `matrix_file_to_file`
    includes it.
    """
    R, t = T_design_scan[:3, :3], T_design_scan[:3, 3]
    x, y, z, w = Rotation.from_matrix(R).as_quat()
    quaternion = np.array([w, x, y, z]) * (-1.0 if w < 0 else 1.0)
    # p_design_file = p_design_mm / mm_per_unit(design), p_scan_mm = p_scan_file * mm_per_unit(scan)
    file_to_file = T_design_scan.copy()
    file_to_file[:3, :3] *= (unit_factor or 1.0) * scan.mm_per_unit / design_mm_per_unit
    file_to_file[:3, 3] /= design_mm_per_unit
    return Transform(
        matrix=T_design_scan.tolist(),
        det=float(np.linalg.det(R)),
        rotation_deg=rigid.angle_deg(T_design_scan),
        quaternion_wxyz=quaternion.tolist(),
        translation_mm=t.tolist(),
        matrix_file_to_file=file_to_file.tolist(),
    )


def scan_quality(quality: ScannerQuality, left_out_share: float) -> ScanQuality:
    """left_out_share : of the scan in stray pieces"""
    return ScanQuality(
        noise_mm=quality.noise_mm,
        accuracy_mm=quality.accuracy_mm,
        residual_limit_mm=quality.residual_limit_mm,
        left_out_share=min(1.0, max(0.0, left_out_share)),
    )


def metrics(registration: Registration, *, has_pose: bool) -> Metrics:
    """What depends on the final transform is null when there is none."""
    under_final, rmse_landmarks = registration.fit, registration.rmse_landmarks_mm
    rmse_complete = registration.rmse_complete_mm
    return Metrics(
        rmse_initial_mm=registration.rmse_initial_mm,
        rmse_landmarks_mm=rmse_landmarks,
        rmse_complete_mm=rmse_complete,
        k_ratio=rmse_complete / rmse_landmarks if rmse_landmarks else None,
        rmse_mm=under_final.rmse_mm if has_pose else None,
        inlier_rmse_mm=under_final.inlier_rmse_mm if has_pose else None,
        inlier_distance_mm=registration.inlier_distance_mm,
        fitness=under_final.fitness if has_pose else None,
        scan_overlap=under_final.overlap if has_pose else None,
        design_coverage=registration.design_coverage if has_pose else None,
        iterations=registration.best.iterations,
        converged=registration.best.converged,
    )


def matches(
    matching: Matching, design: LandmarkSet, scan: LandmarkSet, T_design_scan: FloatArray
) -> list[Match]:
    placed = rigid.transformed(T_design_scan, scan.position_mm[matching.scan])
    residual_mm = np.linalg.norm(placed - design.position_mm[matching.design], axis=1)
    return [
        Match(design=int(i), scan=int(j), residual_mm=float(r))
        for i, j, r in sorted(zip(matching.design, matching.scan, residual_mm, strict=True))
    ]


def observability(registration: Registration) -> Observability:
    seen = registration.observability
    smallest, largest = float(seen.eigenvalues[0]), float(seen.eigenvalues[-1])
    return Observability(
        eigenvalues=seen.eigenvalues.tolist(),
        condition_number=largest / smallest if smallest > 0 else None,
        free_motions=[
            FreeMotion(
                kind=motion.kind,
                axis=motion.axis.tolist(),
                point_mm=motion.point_mm.tolist(),
                sigma_mm=motion.sigma_mm,
            )
            for motion in seen.unconstrained
        ],
    )


def scale(estimate: ScaleDiagnosis, unit_factor: float | None) -> Scale:
    factors = [
        ScaleFactor(
            axis=each.axis,
            scale=each.scale,
            standard_error=each.standard_error,
            slicer_percent=None if each.scale is None else 100 / each.scale,
            reason=each.reason,
        )
        for each in estimate.factors
    ]
    whole, *axes = (each.scale for each in factors)
    per_axis = [each for each in axes if each is not None]
    return Scale(
        isotropic=whole,
        per_axis=per_axis if len(per_axis) == len(axes) else None,
        factors=factors,
        warp_mm=estimate.warp_mm,
        unit_factor=unit_factor,
    )
