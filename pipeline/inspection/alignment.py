"""The alignment that the drawing asks for, from the automatic pose on."""

from dataclasses import dataclass, replace

import numpy as np

from pipeline.analysis.design_model import DesignModel
from pipeline.analysis.scan_registration import RegisteredScan
from pipeline.core.alignment import (
    Alignment,
    BestFit,
    ConstrainedFit,
    LandmarksFit,
    RpsFit,
    ToleranceFit,
)
from pipeline.core.job_parameters import JobParameters
from pipeline.core.mesh import FloatArray
from pipeline.core.results import AlignedPoint, AppliedAlignment, FreeAlignmentMotion
from pipeline.core.sentences import sentence
from pipeline.core.small_motions import named
from pipeline.inspection.aligned_points import Landmarks, fit_landmarks, fit_reference_points
from pipeline.inspection.aligned_surface import fit_surface, fit_tolerances
from pipeline.inspection.alignment_types import AlignmentFailed, Found, Placed
from pipeline.inspection.pose_error import PoseError, of_surface_fit, patch_edge_mm
from pipeline.kernels import rigid
from pipeline.kernels.correlated_noise import noise_of
from pipeline.search.scan_model import ScanPoints
from pipeline.stages.registration import Registration, evaluate_fit

#: An alignment that moves the part farther, over the design's diagonal, is another pose than the one that the
#: verdict judged. Chosen by hand.
MAX_MOVE_SHARE = 0.05


@dataclass(frozen=True, slots=True)
class Aligned:
    """registration : with the fit under the alignment, as deviations and inspection use it; record : of the
    alignment asked for, None where none was; pose_error : of the alignment, None where it is not known
    """

    registration: Registration
    record: AppliedAlignment | None
    pose_error: PoseError | None

    @property
    def problem(self) -> str | None:
        """Why the alignment asked for was not made."""
        return None if self.record is None else self.record.reason


def align(registered: RegisteredScan, design: DesignModel, job: JobParameters) -> Aligned:
    """The registered scan as `job.alignment` wants it.

    Raises
    ------
    UnknownRegion, PointOffSurface
    """
    registration = registered.registration
    if job.alignment is None:
        return Aligned(registration, None, _of_best_fit(registered, design, job))
    scan = registration.scan
    placed = Placed(
        scan=scan,
        weights=scan.weights(),
        start=registration.fit,
        surface=design.surface,
        segment_of_face=np.asarray(design.analysis.segment_of_faces(), dtype=np.int64),
        brep=design.cached.brep,
        inlier_mm=registration.inlier_distance_mm,
        inflation=_inflation(registration, design) if isinstance(job.alignment, RpsFit) else 1.0,
    )
    landmarks = Landmarks(
        registration.matching,
        design.analysis.landmarks.position_mm,
        registered.scan.landmarks.position_mm,
    )
    T_best = registration.fit.T_design_scan
    try:
        found = _found(job.alignment, placed, landmarks, job)
        moved_mm = rigid.rms_displacement(found.T_design_scan, T_best, scan.vertices)
        if moved_mm > MAX_MOVE_SHARE * design.diagonal_mm:
            raise AlignmentFailed(
                sentence(
                    "it would move the part by {distance:.3g} mm from the automatic pose, which is "
                    "farther than an alignment of the same pose can be; check its points and directions",
                    distance=moved_mm,
                )
            )
    except AlignmentFailed as failed:
        return Aligned(registration, _record(job.alignment, placed, None, failed), None)
    fit = evaluate_fit(scan, placed.weights, design.surface, found.T_design_scan, placed.inlier_mm)
    pose_error = found.pose_error
    if isinstance(job.alignment, ToleranceFit) or found.iterations == 0:
        pose_error = _of_best_fit(registered, design, job)
    return Aligned(replace(registration, fit=fit), _record(job.alignment, placed, found, None), pose_error)


def _inflation(registration: Registration, design: DesignModel) -> float:
    """Of the variance of the median at a reference point, by the noise of the scan on the design."""
    fit = registration.fit
    near = np.flatnonzero(fit.closest.distance <= registration.inlier_distance_mm)
    closest, moved = fit.closest.of(near), fit.moved[near]
    height = np.einsum("kd,kd->k", moved - closest.point, closest.normal)
    diameter_mm = patch_edge_mm(registration.scan, design.diagonal_mm)
    return noise_of(closest.point, closest.normal, height, diameter_mm).inflation() if near.size else 1.0


def _of_best_fit(registered: RegisteredScan, design: DesignModel, job: JobParameters) -> PoseError | None:
    """Of the automatic pose, by the samples that it was fitted to; a fit to limits is taken for as good."""
    registration = registered.registration
    samples = ScanPoints.of(registration.scan, job.settings.registration.sample_points, job.seed)
    moved = rigid.transformed(registration.fit.T_design_scan, samples.points)
    closest = design.surface.closest(moved)
    residual = np.einsum("kd,kd->k", moved - closest.point, closest.normal)
    weights = samples.weights * (closest.distance <= registration.inlier_distance_mm)
    edge_mm = patch_edge_mm(registration.scan, design.diagonal_mm)
    return of_surface_fit(closest.point, closest.normal, residual, weights, edge_mm)


def _found(alignment: Alignment, placed: Placed, landmarks: Landmarks, job: JobParameters) -> Found:
    match alignment:
        case BestFit() | ConstrainedFit():
            return fit_surface(placed, alignment)
        case ToleranceFit():
            return fit_tolerances(placed, alignment, job.acceptance, job.tolerance_mm)
        case RpsFit():
            return fit_reference_points(placed, alignment)
        case LandmarksFit():
            return fit_landmarks(placed, alignment, landmarks)


def _record(
    alignment: Alignment, placed: Placed, found: Found | None, failed: AlignmentFailed | None
) -> AppliedAlignment:
    T_best = placed.start.T_design_scan
    motion = np.eye(4) if found is None else found.T_design_scan @ rigid.inverse(T_best)
    middle = np.einsum("k,kd->d", placed.weights / placed.weights.sum(), placed.start.moved)
    moved = rigid.transformed(motion, middle[None])[0] - middle
    points: tuple[AlignedPoint, ...] = () if found is None else found.points
    if failed is not None:
        points = failed.points
    return AppliedAlignment(
        kind=alignment.kind,
        applied=found is not None,
        reason=None if failed is None else str(failed),
        residual_mm=None if found is None else found.residual_mm,
        best_fit_residual_mm=None if found is None else found.best_fit_residual_mm,
        best_fit_matrix=T_best.tolist(),
        translation_mm=float(np.linalg.norm(moved)),
        angle_deg=rigid.angle_deg(motion),
        iterations=0 if found is None else found.iterations,
        free_motions=[] if found is None else _free(found.free, found.centre),
        points=list(points),
    )


def _free(twists: FloatArray, centre: FloatArray) -> list[FreeAlignmentMotion]:
    return [
        FreeAlignmentMotion(kind=each.kind, axis=list(each.axis), point_mm=list(each.point_mm))
        for each in named(twists.tolist(), centre.tolist())
    ]
