"""From seeds to the final pose: ICP on the exact design surface, and what the result is worth in numbers."""

from dataclasses import dataclass, replace

import numpy as np

from pipeline.kernels import icp, rigid, sampling
from pipeline.kernels.free_motions import Observability, observe
from pipeline.kernels.nearest import nearest
from pipeline.kernels.similarity import stretch, warp_mm
from pipeline.kernels.surface import Closest, Surface
from pipeline.mesh import FloatArray, Mesh
from pipeline.settings import RegistrationSettings
from pipeline.stages.matching import Matching

MAX_RIVALS = 7
RIVAL_COST = 2.0  # a hypothesis above this many times the lowest cost is not refined to the end
TRIAL_POINTS = 2_000
TRIAL_ITERATIONS = 30  # enough to tell the seeds apart; the best goes on from there
HOPELESS = 1.3  # times the residual limit after the trials: not this part
CLOSE_RIVALS = 2
CLOSE_COST = 1.3  # a rival below this many times the best's cost is refined on all points too
APART_SHARE = 0.02  # of the diagonal: poses nearer than this are one pose
COVERAGE_POINTS = 10_000
TOLERANCE_SHARE = 2e-5  # of the diagonal: with noise, matches that switch move the pose by 1e-5 for ever


@dataclass(frozen=True, slots=True)
class Pose:
    """T_design_scan; cost_mm2 : mean squared distance truncated at the inlier distance"""

    T_design_scan: FloatArray
    cost_mm2: float
    converged: bool
    iterations: int


@dataclass(frozen=True, slots=True)
class Fit:
    """How the cleaned scan lies on the design under one pose.

    closest : of every scan vertex; rmse_mm : weighted RMS of all distances, untrimmed; fitness : share of the
    scan within the inlier distance; overlap : the same, not on an open border of the design;
    truncated_rms_mm : RMS of the distances, each counted as at most the inlier distance
    """

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
    """best : the final pose; rivals : other distinct poses refined to the end, by cost; fit : under the best.

    rmse_* as in `outcome.Metrics`; observability : of the scan's points that lie on the design
    """

    best: Pose
    rivals: tuple[Pose, ...]
    fit: Fit
    seed: str
    inlier_distance_mm: float
    rmse_initial_mm: float
    rmse_landmarks_mm: float | None
    rmse_complete_mm: float
    design_coverage: float
    observability: Observability
    scale: ScaleFound


@dataclass(frozen=True, slots=True)
class Searched:
    """best, rivals : as in `Registration`; seed : where the best came from"""

    best: Pose
    rivals: tuple[Pose, ...]
    seed: str


def register(
    scan: Mesh, design: Surface, matching: Matching, settings: RegistrationSettings, seed: int, limit_mm: float
) -> Registration:
    """The best pose by `search`, its rivals, and what it is worth. limit_mm : a motion less certain than this is free."""
    diagonal = design.mesh.diagonal_mm
    inlier = settings.inlier_share * diagonal
    found = search(scan, design, matching, settings, seed)
    best = found.best
    every = _scan_points(scan, settings.sample_points, seed)
    complete = _complete(scan, design, settings, diagonal, seed)
    final = fit(scan, design, best.T_design_scan, inlier)
    T_landmarks = matching.T_landmarks
    return Registration(
        best=best,
        rivals=found.rivals,
        fit=final,
        seed=found.seed,
        inlier_distance_mm=inlier,
        rmse_initial_mm=fit(scan, design, np.eye(4), inlier).rmse_mm,
        rmse_landmarks_mm=None if T_landmarks is None else fit(scan, design, T_landmarks, inlier).rmse_mm,
        rmse_complete_mm=fit(scan, design, complete, inlier).rmse_mm,
        design_coverage=_coverage(scan.moved(best.T_design_scan), design.mesh, inlier, seed),
        observability=observed(final, scan.weights(), design, inlier, limit_mm),
        scale=_scale(every, design, best.T_design_scan, inlier),
    )


def search(
    scan: Mesh, design: Surface, matching: Matching, settings: RegistrationSettings, seed: int, *, thorough: bool = True
) -> Searched:
    """Landmarks seed, ICP refines (point to plane on the exact surface), the lowest truncated cost is the pose.

    thorough : False stops at the trials on few points; so does a scan that after them lies far off everywhere, where ICP
    would wander on without ever converging.

    The seed is the fit of the matched landmarks when it lies at least as well as the best hypothesis, else that.
    """
    diagonal = design.mesh.diagonal_mm
    inlier = settings.inlier_share * diagonal
    every = _scan_points(scan, settings.sample_points, seed)
    few = _scan_points(scan, TRIAL_POINTS, seed)

    def refined(T: FloatArray, facing: float, points: ScanPoints, max_iterations: int) -> Pose:
        done = icp.refine(
            points.points,
            None if points.normals is None else facing * points.normals,
            points.weights,
            design,
            T,
            max_distance_mm=inlier,
            max_iterations=max_iterations,
            tolerance_mm=TOLERANCE_SHARE * diagonal,
        )
        T = done.T_target_source
        return Pose(T, _truncated_cost(T, points, design, inlier), done.converged, done.iterations)

    def trial(seed_pose: Seed) -> Pose:
        return refined(seed_pose.T_design_scan, seed_pose.facing, few, min(settings.max_iterations, TRIAL_ITERATIONS))

    seeds = _seeds(matching, few, design, inlier)
    # sorted() is stable: of equally good ones the earlier hypothesis comes first
    tried = sorted(((trial(each), each) for each in seeds), key=lambda pair: pair[0].cost_mm2)
    first, source = tried[0]
    hopeless = first.cost_mm2 > (HOPELESS * settings.max_residual_share * diagonal) ** 2
    if thorough and not hopeless:
        best = refined(first.T_design_scan, source.facing, every, settings.max_iterations)
    else:
        best = replace(first, cost_mm2=_truncated_cost(first.T_design_scan, every, design, inlier))
    apart = APART_SHARE * diagonal
    rivals: list[Pose] = []
    facings: list[float] = []
    for pose, its_seed in tried[1:]:
        known = [best, *rivals]
        if all(rigid.rms_displacement(pose.T_design_scan, each.T_design_scan, few.points) > apart for each in known):
            facings.append(its_seed.facing)
            rivals.append(replace(pose, cost_mm2=_truncated_cost(pose.T_design_scan, every, design, inlier)))
    by_cost = sorted(range(len(rivals)), key=lambda number: rivals[number].cost_mm2)
    for number in by_cost[: CLOSE_RIVALS if thorough and not hopeless else 0]:
        if rivals[number].cost_mm2 < CLOSE_COST * best.cost_mm2:  # refined on all points, the order may turn
            pose = refined(rivals[number].T_design_scan, facings[number], every, settings.max_iterations)
            best, rivals[number] = (pose, best) if pose.cost_mm2 < best.cost_mm2 else (best, pose)
    return Searched(best, tuple(sorted(rivals, key=lambda pose: pose.cost_mm2)), source.source)


def fit(scan: Mesh, design: Surface, T_design_scan: FloatArray, inlier_distance_mm: float) -> Fit:
    """Every vertex of the cleaned scan against the exact design surface, area-weighted (a cloud: 1 a point)."""
    weights = scan.weights()
    moved = rigid.transformed(T_design_scan, scan.vertices)
    closest = design.closest(moved)
    squared = closest.distance**2
    inside = closest.distance <= inlier_distance_mm
    share = float(weights[inside].sum())
    return Fit(
        closest,
        moved,
        rmse_mm=float(np.sqrt((weights * squared).sum())),
        inlier_rmse_mm=float(np.sqrt((weights * squared)[inside].sum() / share)) if share > 0 else None,
        fitness=min(1.0, share),
        overlap=min(1.0, float(weights[inside & ~design.on_open_border(closest)].sum())),
        truncated_rms_mm=float(np.sqrt((weights * np.minimum(squared, inlier_distance_mm**2)).sum())),
    )


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


def _scale(points: "ScanPoints", design: Surface, T_design_scan: FloatArray, inlier_mm: float) -> ScaleFound:
    given = (points.points, points.weights, design, T_design_scan, inlier_mm)
    one, three = stretch(*given, per_axis=False), stretch(*given, per_axis=True)
    bent = three or one
    return ScaleFound(
        None if one is None else float(one.factors[0]),
        None if three is None else three.factors,
        None if bent is None else warp_mm(bent, points.weights),
    )


@dataclass(frozen=True, slots=True)
class ScanPoints:
    """points : (k, 3), each for the same share of the scan; normals : (k, 3), None for a cloud; weights : (k,) sum 1"""

    points: FloatArray
    normals: FloatArray | None
    weights: FloatArray


@dataclass(frozen=True, slots=True)
class Seed:
    """Where an ICP starts; source : `landmarks`, `dense` or `axes`"""

    T_design_scan: FloatArray
    facing: float
    source: str


def _seeds(matching: Matching, points: ScanPoints, design: Surface, inlier_distance_mm: float) -> list[Seed]:
    """The fit of the matched landmarks, or the best hypothesis where that lies clearly better; then its rivals."""
    first, *others = matching.hypotheses
    seeds = [Seed(first.T_design_scan, first.facing, first.source)]
    if matching.T_landmarks is not None:
        by_landmarks = _truncated_cost(matching.T_landmarks, points, design, inlier_distance_mm)
        if by_landmarks <= 2 * _truncated_cost(first.T_design_scan, points, design, inlier_distance_mm):
            seeds = [Seed(matching.T_landmarks, first.facing, "landmarks")]
    worst = RIVAL_COST * max(first.cost_mm2, 1e-12 * design.mesh.diagonal_mm**2)
    seeds += [Seed(rival.T_design_scan, rival.facing, rival.source) for rival in others if rival.cost_mm2 <= worst]
    return seeds[: 1 + MAX_RIVALS]


def _truncated_cost(T: FloatArray, points: ScanPoints, design: Surface, inlier_distance_mm: float) -> float:
    distance = design.closest(rigid.transformed(T, points.points)).distance
    return float(points.weights @ np.minimum(distance, inlier_distance_mm) ** 2)


def _scan_points(scan: Mesh, count: int, seed: int) -> ScanPoints:
    """Points for the ICP; a cloud has no normals to compare."""
    if scan.is_cloud:
        chosen = np.sort(np.random.default_rng(seed).permutation(len(scan.vertices))[:count])
        return ScanPoints(scan.vertices[chosen], None, np.full(len(chosen), 1.0 / len(chosen)))
    samples = sampling.on_surface(scan, count, seed)
    return ScanPoints(samples.points, samples.normals, np.full(count, 1.0 / count))


def _complete(scan: Mesh, design: Surface, settings: RegistrationSettings, diagonal: float, seed: int) -> FloatArray:
    """T_design_scan of plain ICP from the uploaded pose, without landmarks: the comparison for K."""
    few = _scan_points(scan, TRIAL_POINTS, seed)
    return icp.complete_shape(
        few.points,
        few.weights,
        design,
        max_iterations=settings.max_iterations,
        tolerance_mm=TOLERANCE_SHARE * diagonal,
    ).T_target_source


def _coverage(scan_in_design: Mesh, design: Mesh, inlier_distance_mm: float, seed: int) -> float:
    samples = sampling.on_surface(design, COVERAGE_POINTS, seed).points
    if scan_in_design.is_cloud:
        distance, _ = nearest(scan_in_design.vertices, samples)
    else:
        distance = Surface(scan_in_design).closest(samples).distance
    return float(np.mean(distance <= inlier_distance_mm))
