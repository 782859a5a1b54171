"""How far a pose is from the nearest true pose of a case of the gauntlet."""

from dataclasses import dataclass

import numpy as np

import pipeline
from pipeline.core.mesh import FloatArray, Mesh
from pipeline.kernels import icp, rigid
from pipeline.kernels.surface import Surface
from pipeline.search.scan_model import ScanPoints
from pipeline.search.schedule import REGISTRATION
from tests.accuracy.gauntlet_cases import Case


@dataclass(frozen=True, slots=True)
class PoseError:
    """Of a pose against the nearest truth."""

    right: bool
    at_rival: bool
    error_share: float
    rotation_deg: float
    translation_share: float
    rms_share: float
    rms_true_share: float
    from_truth_share: float


def error(case: Case, T_design_scan: FloatArray) -> PoseError | None:
    """None where no pose is right."""
    if not case.truths:
        return None
    points, size = case.unit_factor * case.scan.vertices, case.design.diagonal_mm
    poses = (*case.truths, *case.rivals)
    far = [rigid.rms_displacement(T_design_scan, T, points) / size for T in poses]
    nearest = int(np.argmin(far))
    apart, truth = far[nearest], poses[nearest]
    surface, centroid = Surface(case.design), points.mean(axis=0, keepdims=True)

    def rms_share(T: FloatArray) -> float:
        return float(np.sqrt((surface.closest(rigid.transformed(T, points)).distance ** 2).mean())) / size

    return PoseError(
        right=apart <= case.tolerance_share,
        at_rival=nearest >= len(case.truths),
        error_share=apart,
        rotation_deg=rigid.angle_deg(T_design_scan @ np.linalg.inv(truth)),
        translation_share=rigid.rms_displacement(T_design_scan, truth, centroid) / size,
        rms_share=rms_share(T_design_scan),
        rms_true_share=rms_share(truth),
        from_truth_share=rigid.rms_displacement(_icp_from(truth, case, points, surface), truth, points)
        / size,
    )


def _icp_from(truth: FloatArray, case: Case, points: FloatArray, surface: Surface) -> FloatArray:
    """Where ICP ends that starts at the truth: what the surfaces themselves allow. The pipeline's own
    number of points.
    """
    asked = pipeline.Settings().registration
    scan = Mesh(points, case.scan.faces)
    from_scan = ScanPoints.of(scan, asked.sample_points, 1)
    return icp.refine(
        from_scan.points,
        None if case.group == "depth camera" else from_scan.normals,  # which may face inwards
        from_scan.weights,
        surface,
        truth,
        max_distance_mm=asked.inlier_share * case.design.diagonal_mm,
        max_iterations=asked.max_iterations,
        tolerance_mm=REGISTRATION.convergence_share * case.design.diagonal_mm,
    ).T_target_source
