"""Registration: the final pose by ICP on the exact design surface, and its quality in numbers."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from pipeline.core.mesh import FloatArray, Mesh
from pipeline.core.settings import RegistrationSettings
from pipeline.core.stations import Stations
from pipeline.kernels import icp, rigid
from pipeline.kernels.observability import Observability, observe
from pipeline.kernels.surface import Closest, Surface
from pipeline.search.pose_search import search_pose
from pipeline.search.scan_model import ScanModel, ScanPoints
from pipeline.search.schedule import REGISTRATION
from pipeline.search.types import Matching, Pose

#: A scan with fewer vertices (a CAD file sent as a scan: a box has eight, all at its corners) is observed at
#: samples of its surface instead. Chosen by hand: the samples of the plain ICP are as many.
MIN_OBSERVED_VERTICES = 500
OBSERVED_TRUNCATION = 2.0  # inlier distances: a test motion may take inliers beyond one. Chosen by hand


@dataclass(frozen=True, slots=True)
class Fit:
    """How the cleaned scan lies on the design under one pose.

    closest : design point closest to each scan vertex; moved : (n, 3) the vertices in the design's frame;
    rmse_mm : area-weighted RMS of all distances, untrimmed; inlier_rmse_mm : of those within the inlier
    distance, None without any; fitness : area share of the scan within the inlier distance; overlap : the
    same without what is closest to an open border of the design; truncated_rms_mm : RMS of the distances,
    each at most the inlier distance
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
class Registration:
    """best : the final pose; alternatives : other distinct poses, by score; fit : under the best; source :
    what the best started from; matching : landmark matches under the best; rmse_* : as in
    `core.results.Metrics`;
    observability : of the scan points that lie on the design; scan : the cleaned scan; scan_surface : its
    surface in its own frame, None for a point cloud; ignored_stations : as in `SearchResult`
    """

    scan: Mesh
    best: Pose
    alternatives: tuple[Pose, ...]
    fit: Fit
    source: str
    matching: Matching
    inlier_distance_mm: float
    rmse_initial_mm: float
    rmse_landmarks_mm: float | None
    rmse_complete_mm: float
    design_coverage: float
    observability: Observability
    scan_surface: Surface | None
    ignored_stations: bool = False


def register(
    scan: Mesh,
    design: Surface,
    matching: Matching,
    match_under: Callable[[FloatArray], Matching],
    settings: RegistrationSettings,
    seed: int,
    max_sigma_mm: float,
    stations: Stations | None = None,
) -> Registration:
    """The best pose by `search.pose_search`, its alternatives, and its quality.

    match_under : the landmark matches under a pose T_design_scan; max_sigma_mm : a motion that is less
    certain (1 sigma) is unconstrained; stations : where the scanner stood, where that is known
    """
    inlier_mm = settings.inlier_distance_mm(design.mesh.diagonal_mm)
    model, weights = ScanModel.of(scan, settings, seed, stations), scan.weights()
    search = search_pose(model, design, matching, settings)
    few = ScanPoints.of(scan, REGISTRATION.complete_samples, seed)
    T_complete = _icp_of_complete_shape(few, design, settings)
    fit = evaluate_fit(scan, weights, design, search.best.T_design_scan, inlier_mm)
    observed = (fit, weights)
    if not scan.is_cloud and len(scan.vertices) < MIN_OBSERVED_VERTICES:
        sampled = Mesh(few.points)
        observed = (
            evaluate_fit(sampled, few.weights, design, search.best.T_design_scan, inlier_mm),
            few.weights,
        )
    matching = match_under(search.best.T_design_scan)
    T_landmarks = matching.T_landmarks
    return Registration(
        scan=scan,
        best=search.best,
        alternatives=search.alternatives,
        fit=fit,
        source=search.source,
        matching=matching,
        inlier_distance_mm=inlier_mm,
        rmse_initial_mm=rmse_mm(scan, weights, design, np.eye(4)),
        rmse_landmarks_mm=None if T_landmarks is None else rmse_mm(scan, weights, design, T_landmarks),
        rmse_complete_mm=rmse_mm(scan, weights, design, T_complete),
        design_coverage=search.best.coverage,
        observability=assess_observability(*observed, design, inlier_mm, max_sigma_mm),
        scan_surface=model.surface,
        ignored_stations=search.ignored_stations,
    )


def evaluate_fit(
    scan: Mesh, weights: FloatArray, design: Surface, T_design_scan: FloatArray, inlier_distance_mm: float
) -> Fit:
    """Every vertex of the cleaned scan against the exact design surface. weights : (n,) `scan.weights()`"""
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
    """`Fit.rmse_mm` alone; of more vertices than `REGISTRATION.max_rmse_vertices` every k-th counts."""
    some = slice(None, None, -(-len(weights) // REGISTRATION.max_rmse_vertices))
    distance = design.closest(rigid.transformed(T_design_scan, scan.vertices[some])).distance
    return float(np.sqrt((weights[some] * distance**2).sum() / weights[some].sum()))


def assess_observability(
    fit: Fit, weights: FloatArray, design: Surface, inlier_distance_mm: float, max_sigma_mm: float
) -> Observability:
    """Of the scan's vertices within the inlier distance; a motion less certain than `max_sigma_mm` is
    unconstrained.
    """
    residual = np.einsum("kd,kd->k", fit.closest.normal, fit.moved - fit.closest.point)
    inlier_weights = weights * (fit.closest.distance <= inlier_distance_mm)
    some = np.flatnonzero(inlier_weights > 0)
    some = some[:: max(1, len(some) // REGISTRATION.coarse_samples)]
    truncation_mm = OBSERVED_TRUNCATION * inlier_distance_mm

    def cost_mm2(T: FloatArray) -> float:
        distance = design.closest(rigid.transformed(T, fit.moved[some]), fit.closest.face[some]).distance
        return float(np.average(np.minimum(distance, truncation_mm) ** 2, weights=inlier_weights[some]))

    return observe(fit.moved, fit.closest.normal, residual, inlier_weights, max_sigma_mm, cost_mm2)


def _icp_of_complete_shape(points: ScanPoints, design: Surface, settings: RegistrationSettings) -> FloatArray:
    """T_design_scan of plain ICP from the uploaded pose, without landmarks: the paper's comparison for K."""
    return icp.complete_shape(
        points.points,
        points.weights,
        design,
        max_iterations=settings.max_iterations,
        tolerance_mm=REGISTRATION.convergence_share * design.mesh.diagonal_mm,
    ).T_target_source
