"""From the other poses of a registration to their records: one row each, and one for all that are equivalent
by a symmetry of the design.
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from pipeline.core.mesh import FloatArray
from pipeline.core.results import Alternative, Symmetry, SymmetryAxis
from pipeline.kernels import rigid
from pipeline.kernels.surface import Surface
from pipeline.search.score_ratio import score_ratio
from pipeline.search.types import Pose
from pipeline.stages.registration import Registration, evaluate_fit
from pipeline.verification.hypothesis_checks import HypothesisChecks

#: Two axes are one when the cosine of their angle is above this (2.5 degrees). Chosen by hand.
SAME_AXIS_COS = 0.999
#: Rotations by less than this have no axis. Chosen by hand.
MIN_TURN_DEG = 1.0


@dataclass(frozen=True, slots=True)
class AlternativePose:
    """pose; rmse_mm : over all vertices of the cleaned scan; stands_for : equivalent poses by symmetry, 0 for
    a pose that is none
    """

    pose: Pose
    rmse_mm: float
    stands_for: int


def listed_alternatives(
    registration: Registration, checks: HypothesisChecks, design: Surface, *, rejected: bool
) -> tuple[AlternativePose, ...]:
    """The poses to report, with their RMSE: where the best was rejected, that one first; then other poses by
    score; then one for the symmetry-equivalent poses.
    """
    fit = registration.fit
    rows = [AlternativePose(registration.best, fit.rmse_mm, 0)] if rejected else []
    pairs = list(zip(registration.alternatives, checks.symmetric, strict=True))
    others = [(pose, 0) for pose, symmetric in pairs if not symmetric]
    equivalent = [pose for pose, symmetric in pairs if symmetric]
    scan, weights = registration.scan, registration.scan.weights()
    for pose, stands_for in [*others, *((pose, len(equivalent)) for pose in equivalent[:1])]:
        T, inlier_mm = pose.T_design_scan, registration.inlier_distance_mm
        rmse_mm = evaluate_fit(scan, weights, design, T, inlier_mm).rmse_mm
        rows.append(AlternativePose(pose, rmse_mm, stands_for))
    return tuple(rows)


def alternative_records(
    rows: tuple[AlternativePose, ...], best: Pose, design_diagonal_mm: float
) -> list[Alternative]:
    """Their records; `score` is the ratio that the verdict compares."""
    return [
        Alternative(
            matrix=row.pose.T_design_scan.tolist(),
            score=score_ratio(row.pose.score_mm2, best.score_mm2, design_diagonal_mm),
            rmse_mm=row.rmse_mm,
            symmetry_of_design=row.stands_for > 0,
            equivalent_poses=max(1, row.stands_for),
        )
        for row in rows
    ]


def symmetry_record(registration: Registration, checks: HypothesisChecks) -> Symmetry | None:
    """The equivalent poses as motions of the design; None without any."""
    T_back = rigid.inverse(registration.best.T_design_scan)
    pairs = zip(registration.alternatives, checks.symmetric, strict=True)
    motions = [pose.T_design_scan @ T_back for pose, symmetric in pairs if symmetric]
    free = registration.observability.unconstrained
    if not motions and not free:
        return None
    if not free:
        order, axes = 1 + len(motions), _axes(motions)
        return Symmetry(
            kind="discrete", order=order, axes=axes, motions=[motion.tolist() for motion in motions]
        )
    continuous = [
        SymmetryAxis(axis=motion.axis.tolist(), point_mm=motion.point_mm.tolist(), order=None)
        for motion in free
        if motion.kind == "rotation"
    ]
    return Symmetry(
        kind="continuous", order=None, axes=continuous, motions=[motion.tolist() for motion in motions]
    )


def _axes(motions: list[FloatArray]) -> list[SymmetryAxis]:
    """The axes of the turns among `motions`, each once, the one of most turns first."""
    found: list[tuple[FloatArray, FloatArray, int]] = []  # axis, point, order
    for motion in motions:
        turn = Rotation.from_matrix(motion[:3, :3]).as_rotvec()
        angle = float(np.linalg.norm(turn))
        if angle < np.radians(MIN_TURN_DEG):
            continue
        axis = turn / angle * (1.0 if turn[int(np.abs(turn).argmax())] > 0 else -1.0)
        known = [k for k, (each, _, _) in enumerate(found) if abs(float(each @ axis)) > SAME_AXIS_COS]
        if known:
            each, point, order = found[known[0]]
            found[known[0]] = (each, point, order + 1)
            continue
        # (I - R) p = t has the points of the axis as its solutions; least squares takes the nearest
        solved = np.linalg.lstsq(np.eye(3) - motion[:3, :3], motion[:3, 3], rcond=None)[0]
        found.append((axis, np.asarray(solved, dtype=np.float64), 2))
    found.sort(key=lambda each: -each[2])  # stable
    return [
        SymmetryAxis(axis=axis.tolist(), point_mm=point.tolist(), order=order) for axis, point, order in found
    ]
