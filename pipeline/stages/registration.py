"""From seeds to the final pose: ICP on the exact design surface, and what the result is worth in numbers."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from pipeline.core.mesh import FloatArray, Mesh
from pipeline.core.settings import RegistrationSettings
from pipeline.kernels import icp, rigid
from pipeline.kernels.observability import Observability, observe
from pipeline.kernels.similarity import estimate_scale, residual_deformation_mm
from pipeline.kernels.surface import Closest, Surface
from pipeline.search.pose_search import TOLERANCE_SHARE, TRIAL_POINTS, Pose, Scan, ScanPoints, search
from pipeline.stages.matching import Matching


@dataclass(frozen=True, slots=True)
class Fit:
    """How the cleaned scan lies on the design under one pose.

    closest : of every scan vertex; rmse_mm : weighted RMS of all distances, untrimmed; fitness : share of the
    scan within the inlier distance; overlap : the same, not on an open border of the design;
    truncated_rms_mm : RMS of the distances, each counted as at most the inlier distance
    """

    T_design_scan: FloatArray
    closest: Closest
    moved: FloatArray
    rmse_mm: float
    inlier_rmse_mm: float | None
    fitness: float
    overlap: float
    truncated_rms_mm: float


@dataclass(frozen=True, slots=True)
class ScaleFound:
    """isotropic; per_axis : (3,) along the design's axes; warp_mm : what stays bent after the latter; None: cannot tell"""

    isotropic: float | None
    per_axis: FloatArray | None
    warp_mm: float | None


@dataclass(frozen=True, slots=True)
class Registration:
    """best : the final pose; rivals : other distinct poses, by score, those near the best refined to the end; fit : under
    the best.

    matching : of the landmarks under the best; rmse_* as in `outcome.Metrics`; observability : of the scan's points that lie
    on the design; scan_surface : of the cleaned scan in its own frame, None of points
    """

    best: Pose
    rivals: tuple[Pose, ...]
    fit: Fit
    seed: str
    matching: Matching
    inlier_distance_mm: float
    rmse_initial_mm: float
    rmse_landmarks_mm: float | None
    rmse_complete_mm: float
    design_coverage: float
    observability: Observability
    scale: ScaleFound
    scan_surface: Surface | None


def register(
    scan: Mesh,
    design: Surface,
    matching: Matching,
    matched_under: Callable[[FloatArray], Matching],
    settings: RegistrationSettings,
    seed: int,
    limit_mm: float,
) -> Registration:
    """The best pose by `pose_search.search`, its rivals, and what it is worth.

    matched_under : the landmarks that match under a pose; limit_mm : a motion less certain than this is free.
    """
    inlier = settings.inlier_share * design.mesh.diagonal_mm
    asked, weights = Scan(scan, settings, seed), scan.weights()
    found = search(asked, design, matching, settings)
    best = found.best
    complete = _complete(asked.few, design, settings)
    final = fit(scan, weights, design, best.T_design_scan, inlier)
    matching = matched_under(best.T_design_scan)
    T_landmarks = matching.T_landmarks
    return Registration(
        best=best,
        rivals=found.rivals,
        fit=final,
        seed=found.seed,
        matching=matching,
        inlier_distance_mm=inlier,
        rmse_initial_mm=rmse_mm(scan, weights, design, np.eye(4)),
        rmse_landmarks_mm=None if T_landmarks is None else rmse_mm(scan, weights, design, T_landmarks),
        rmse_complete_mm=rmse_mm(scan, weights, design, complete),
        design_coverage=best.coverage,
        observability=observed(final, weights, design, inlier, limit_mm),
        scale=_scale(asked.every, design, best.T_design_scan, inlier),
        scan_surface=asked.surface,
    )


def fit(
    scan: Mesh, weights: FloatArray, design: Surface, T_design_scan: FloatArray, inlier_distance_mm: float
) -> Fit:
    """Every vertex of the cleaned scan against the exact design surface; weights : `scan.weights()`"""
    moved = rigid.transformed(T_design_scan, scan.vertices)
    closest = design.closest(moved)
    squared = closest.distance**2
    inside = closest.distance <= inlier_distance_mm
    share = float(weights[inside].sum())
    return Fit(
        T_design_scan,
        closest,
        moved,
        rmse_mm=float(np.sqrt((weights * squared).sum())),
        inlier_rmse_mm=float(np.sqrt((weights * squared)[inside].sum() / share)) if share > 0 else None,
        fitness=min(1.0, share),
        overlap=min(1.0, float(weights[inside & ~design.on_open_border(closest)].sum())),
        truncated_rms_mm=float(np.sqrt((weights * np.minimum(squared, inlier_distance_mm**2)).sum())),
    )


def rmse_mm(scan: Mesh, weights: FloatArray, design: Surface, T_design_scan: FloatArray) -> float:
    """`Fit.rmse_mm` alone."""
    distance = design.closest(rigid.transformed(T_design_scan, scan.vertices)).distance
    return float(np.sqrt((weights * distance**2).sum()))


def observed(
    fit: Fit, weights: FloatArray, design: Surface, inlier_distance_mm: float, limit_mm: float
) -> Observability:
    """Of the scan's vertices within the inlier distance; a motion less certain than `limit_mm` is free."""
    residual = np.einsum("kd,kd->k", fit.closest.normal, fit.moved - fit.closest.point)
    inside = weights * (fit.closest.distance <= inlier_distance_mm)
    few = np.flatnonzero(inside > 0)
    few = few[:: max(1, len(few) // TRIAL_POINTS)]

    def cost_mm2(T: FloatArray) -> float:
        distance = design.closest(rigid.transformed(T, fit.moved[few])).distance
        return float(np.average(np.minimum(distance, 2 * inlier_distance_mm) ** 2, weights=inside[few]))

    return observe(fit.moved, fit.closest.normal, residual, inside, limit_mm, cost_mm2)


def _scale(points: ScanPoints, design: Surface, T_design_scan: FloatArray, inlier_mm: float) -> ScaleFound:
    given = (points.points, points.weights, design, T_design_scan, inlier_mm)
    one, three = estimate_scale(*given, per_axis=False), estimate_scale(*given, per_axis=True)
    # a surface that hardly tells its size lets the noise say anything
    one, three = (each if each is not None and _is_likely(each.factors) else None for each in (one, three))
    bent = three or one
    return ScaleFound(
        None if one is None else float(one.factors[0]),
        None if three is None else three.factors,
        None if bent is None else residual_deformation_mm(bent, points.weights),
    )


def _is_likely(factors: FloatArray) -> bool:
    return bool(np.isfinite(factors).all() and (np.abs(np.log2(np.maximum(factors, 1e-300))) < 1).all())


def _complete(few: ScanPoints, design: Surface, settings: RegistrationSettings) -> FloatArray:
    """T_design_scan of plain ICP from the uploaded pose, without landmarks: the comparison for K."""
    return icp.complete_shape(
        few.points,
        few.weights,
        design,
        max_iterations=settings.max_iterations,
        tolerance_mm=TOLERANCE_SHARE * design.mesh.diagonal_mm,
    ).T_target_source
