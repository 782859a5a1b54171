"""Equivalent poses: what the design's symmetries make of the best pose, and which alternatives are such
poses.
"""

from dataclasses import replace

from pipeline.analysis.design_model import DesignModel
from pipeline.analysis.scan_registration import MatchedScan, RegisteredScan, register_scan
from pipeline.core.job_parameters import JobParameters
from pipeline.core.mesh import FloatArray
from pipeline.kernels import rigid
from pipeline.search.scan_model import ScanPoints
from pipeline.search.schedule import REGISTRATION
from pipeline.search.score_ratio import SCORE_LIMITS
from pipeline.search.types import Pose
from pipeline.stages.matching import match_landmarks
from pipeline.verification.thresholds import HYPOTHESES


def add_equivalent_poses(
    registered: RegisteredScan, design: DesignModel, job: JobParameters
) -> tuple[RegisteredScan, tuple[bool, ...]]:
    """The registration with every symmetry-equivalent pose among its alternatives, and for each alternative
    whether it is one.

    A design that is its own image but for a small mark is evaluated in each of its poses: the mark
    distinguishes them.
    """
    symmetry = design.symmetry
    if not (symmetry.elements or symmetry.approximate):
        return registered, _are_symmetric(registered, design)
    fine = ScanPoints.of(registered.scan.mesh, job.settings.registration.sample_points, job.seed)
    registered = _best_of_equivalents(registered, fine, design, job)
    best, alternatives = registered.registration.best, registered.registration.alternatives
    symmetric = _are_symmetric(registered, design)
    T_back = rigid.inverse(best.T_design_scan)
    motions = [pose.T_design_scan @ T_back for pose in alternatives]
    missing = [each for each in symmetry.elements if not any(symmetry.same(each, T) for T in motions)]
    evaluated = (_evaluate(each @ best.T_design_scan, registered, fine, design) for each in missing)
    added = tuple(pose for pose in evaluated if _is_as_good(pose, best, design))
    registration = replace(registered.registration, alternatives=(*alternatives, *added))
    return replace(registered, registration=registration), (*symmetric, *(True for _ in added))


def _best_of_equivalents(
    registered: RegisteredScan, fine: ScanPoints, design: DesignModel, job: JobParameters
) -> RegisteredScan:
    """Registered anew from an equivalent pose, where one fits clearly better than the best so far."""
    best, inlier_mm = registered.registration.best, registered.registration.inlier_distance_mm
    motions = (*design.symmetry.elements, *design.symmetry.approximate)
    equivalents = [motion @ best.T_design_scan for motion in motions]
    coarse = ScanPoints.of(registered.scan.mesh, REGISTRATION.coarse_samples, job.seed)
    closest = min(equivalents, key=lambda T: coarse.evaluate(T, design.surface, inlier_mm).cost_mm2)
    threshold_mm2 = (HYPOTHESES.symmetry_better_share * design.diagonal_mm) ** 2
    limit_mm2 = HYPOTHESES.symmetry_better_ratio * best.cost_mm2 - threshold_mm2
    if _evaluate(closest, registered, fine, design).cost_mm2 < limit_mm2:
        return register_from(closest, registered, design, job)
    return registered


def _evaluate(
    T_design_scan: FloatArray, registered: RegisteredScan, points: ScanPoints, design: DesignModel
) -> Pose:
    """The best pose moved to `T_design_scan`, with its cost on all `points` there."""
    cost = points.evaluate(T_design_scan, design.surface, registered.registration.inlier_distance_mm)
    return replace(
        registered.registration.best,
        T_design_scan=T_design_scan,
        cost_mm2=cost.cost_mm2,
        rmse_mm=cost.rmse_mm,
        score_mm2=cost.cost_mm2,
    )


def _are_symmetric(registered: RegisteredScan, design: DesignModel) -> tuple[bool, ...]:
    best = registered.registration.best
    T_back = rigid.inverse(best.T_design_scan)
    return tuple(
        _is_as_good(pose, best, design) and design.symmetry.contains(pose.T_design_scan @ T_back)
        for pose in registered.registration.alternatives
    )


def _is_as_good(pose: Pose, best: Pose, design: DesignModel) -> bool:
    """False where the scan itself distinguishes the pose from the best, by a mark that the symmetry
    ignores.
    """
    allowance_mm2 = (HYPOTHESES.equal_pose_share * design.diagonal_mm) ** 2
    return pose.cost_mm2 <= SCORE_LIMITS.loose_fit_margin * best.cost_mm2 + allowance_mm2


def register_from(
    T_design_scan: FloatArray, registered: RegisteredScan, design: DesignModel, job: JobParameters
) -> RegisteredScan:
    """Registered anew, `T_design_scan` the first hypothesis."""
    matching, best = registered.registration.matching, registered.registration.best
    first = replace(matching.hypotheses[0], T_design_scan=T_design_scan, normal_sign=best.normal_sign)
    restarted = match_landmarks(
        design.described.landmarks,
        registered.described.landmarks,
        (first, *matching.hypotheses),
        T_design_scan,
        design.matching_mm,
    )
    return register_scan(MatchedScan(registered.scan, registered.described, restarted), design, job)
