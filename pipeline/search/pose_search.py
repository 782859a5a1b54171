"""From seeds to the pose: short ICPs on few points, then what each pose leaves, hides and fails to cover, then ICP to the end.

The score of a pose is the mean squared distance of the scan to the design, truncated at the inlier distance; to it comes
what distances cannot say: the share of the scan that the design would have hidden from every scanner, and the share of the
design that the scan shows under another pose and not under this one. Both count as that share lying off the design.
"""

from dataclasses import dataclass, replace

import numpy as np

from pipeline.core.mesh import FloatArray, Mesh
from pipeline.core.settings import RegistrationSettings
from pipeline.kernels import icp, rigid, sampling
from pipeline.kernels.nearest import nearest
from pipeline.kernels.surface import Surface
from pipeline.kernels.visibility import ViewModel
from pipeline.search import score_ratio as margin
from pipeline.stages.matching import Matching

MAX_RIVALS = 9
RIVAL_COST = (
    3.0  # a hypothesis above this many times the lowest cost is not tried: well above every margin asked for
)
TRIAL_POINTS = 2_000
TRIAL_ITERATIONS = 30  # enough to tell the seeds apart; the best goes on from there
HOPELESS = 1.3  # times the residual limit after the trials: not this part
CLOSE_RIVALS = 6  # so many are refined on all points beside the best; of a plane there is no end
CLOSE = 1.1  # times the margin that is asked for: a rival that scores less is refined on all points too
APART_SHARE = 0.01  # of the diagonal: poses nearer than this count as one
TOLERANCE_SHARE = 2e-5  # of the diagonal: with noise, matches that switch move the pose by 1e-5 for ever
COVERAGE_POINTS = 10_000
VIEWED_POINTS = 500
ALIKE = 0.03  # shares of the scan or the design that differ by less between two poses speak for neither


@dataclass(frozen=True, slots=True)
class Pose:
    """T_design_scan; cost_mm2, rmse_mm : as in `Left`; hidden_share, coverage : of the scan, what the design hides; of the
    design, what the scan shows; score_mm2 : cost and what these two add, beside the other poses; facing : -1 when the
    scan's normals point inwards under it
    """

    T_design_scan: FloatArray
    cost_mm2: float
    rmse_mm: float
    converged: bool
    iterations: int
    hidden_share: float = 0.0
    coverage: float = 1.0
    score_mm2: float = 0.0
    facing: float = 1.0


@dataclass(frozen=True, slots=True)
class ScanPoints:
    """points : (k, 3), each for the same share of the scan; normals : (k, 3), None for a cloud; weights : (k,) sum 1"""

    points: FloatArray
    normals: FloatArray | None
    weights: FloatArray

    @classmethod
    def of(cls, scan: Mesh, count: int, seed: int) -> "ScanPoints":
        """A cloud has no normals to compare."""
        if scan.is_cloud:
            chosen = np.sort(np.random.default_rng(seed).permutation(len(scan.vertices))[:count])
            return cls(scan.vertices[chosen], None, np.full(len(chosen), 1.0 / len(chosen)))
        samples = sampling.on_surface(scan, count, seed)
        return cls(samples.points, samples.normals, np.full(count, 1.0 / count))

    def left(self, T_design_scan: FloatArray, design: Surface, inlier_distance_mm: float) -> "Left":
        distance = design.closest(rigid.transformed(T_design_scan, self.points)).distance
        # sums by numpy itself: a dot product of many points is split among threads
        cost_mm2 = float((self.weights * np.minimum(distance, inlier_distance_mm) ** 2).sum())
        return Left(cost_mm2, float(np.sqrt((self.weights * distance**2).sum())))


@dataclass(frozen=True, slots=True)
class Left:
    """What a pose leaves: cost_mm2 : mean squared distance, truncated at the inlier distance; rmse_mm : RMS distance"""

    cost_mm2: float
    rmse_mm: float


@dataclass(frozen=True, slots=True)
class Seed:
    """Where an ICP starts; source : `landmarks`, `dense` or `axes`"""

    T_design_scan: FloatArray
    facing: float
    source: str


@dataclass(frozen=True, slots=True)
class Searched:
    """best : the final pose; rivals : other distinct poses, by score; seed : where the best came from"""

    best: Pose
    rivals: tuple[Pose, ...]
    seed: str


class Scan:
    """The scan as the search asks it: few points, many points, views, and what it shows of a design."""

    def __init__(self, mesh: Mesh, settings: RegistrationSettings, seed: int) -> None:
        self.mesh = mesh
        self.every = ScanPoints.of(mesh, settings.sample_points, seed)
        self.few = ScanPoints.of(mesh, TRIAL_POINTS, seed)
        self.surface = None if mesh.is_cloud else Surface(mesh)
        self._seed = seed

    def views(self, facing: float) -> ViewModel | None:
        """None of a cloud, which has no outer side."""
        if self.few.normals is None:
            return None
        some = slice(None, None, max(1, len(self.few.points) // VIEWED_POINTS))
        return ViewModel.of(self.few.points[some], facing * self.few.normals[some])

    def coverage(
        self, T_design_scan: FloatArray, facing: float, design: Surface, inlier_distance_mm: float
    ) -> float:
        """Share of the design within the inlier distance of the scan, and facing the same way: the scan of one side of a
        thin wall does not show the other.
        """
        samples = sampling.on_surface(design.mesh, COVERAGE_POINTS, self._seed)
        T_scan_design = rigid.inverse(T_design_scan)
        in_scan = rigid.transformed(T_scan_design, samples.points)
        if self.surface is None:
            distance, _ = nearest(self.mesh.vertices, in_scan)
            return float(np.mean(distance <= inlier_distance_mm))
        found = self.surface.closest(in_scan)
        turned = samples.normals @ T_scan_design[:3, :3].T
        agrees = facing * np.einsum("kd,kd->k", turned, found.normal) > 0
        return float(np.mean((found.distance <= inlier_distance_mm) & agrees))


def search(
    scan: Scan, design: Surface, matching: Matching, settings: RegistrationSettings, *, thorough: bool = True
) -> Searched:
    """Landmarks seed, ICP refines (point to plane on the exact surface), the lowest score is the pose.

    thorough : False stops at the trials on few points; so does a scan that after them lies far off everywhere, where ICP
    would wander on without ever converging.

    The seed is the fit of the matched landmarks when it lies at least as well as the best hypothesis, else that.
    """
    diagonal = design.mesh.diagonal_mm
    inlier = settings.inlier_share * diagonal

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
        left = points.left(T, design, inlier)
        return Pose(T, left.cost_mm2, left.rmse_mm, done.converged, done.iterations, facing=facing)

    def trial(seed: Seed) -> Pose:
        return refined(
            seed.T_design_scan, seed.facing, scan.few, min(settings.max_iterations, TRIAL_ITERATIONS)
        )

    def examined(pose: Pose) -> Pose:
        """On all points what it leaves, and what else speaks for it or against."""
        T, facing, views = pose.T_design_scan, pose.facing, scan.views(pose.facing)
        left = scan.every.left(T, design, inlier)
        hidden = 0.0 if views is None else views.occlusion_ratio(T, design, inlier)
        coverage = scan.coverage(T, facing, design, inlier)
        return replace(
            pose, cost_mm2=left.cost_mm2, rmse_mm=left.rmse_mm, hidden_share=hidden, coverage=coverage
        )

    seeds = _seeds(matching, scan.few, design, inlier)
    # sorted() is stable: of equally good ones the earlier hypothesis comes first
    tried = sorted(((trial(each), each) for each in seeds), key=lambda pair: pair[0].cost_mm2)
    kept = _apart([pose for pose, _ in tried], scan.few.points, APART_SHARE * diagonal)
    tried = [(pose, seed) for pose, seed in tried if any(pose is each for each in kept)]
    hopeless = tried[0][0].cost_mm2 > (HOPELESS * settings.max_residual_share * diagonal) ** 2
    sources = [seed.source for _, seed in tried]
    poses = scored([examined(pose) for pose, _ in tried], inlier)
    finished: set[int] = set()
    # Refined on all points, the order may turn: until the best is finished, and those that come near it.
    while thorough and not hopeless:
        number, *others = sorted(range(len(poses)), key=lambda number: poses[number].score_mm2)
        best = poses[number]
        if number in finished:
            # a little more than the verdict may find it to leave, which looks at every vertex
            needed = CLOSE * margin.needed(CLOSE * float(np.sqrt(best.cost_mm2)), diagonal, settings)
            close = [
                other
                for other in others
                if other not in finished
                and margin.ratio(poses[other].score_mm2, best.score_mm2, diagonal) < needed
            ]
            if not close or len(finished) > CLOSE_RIVALS:
                break
            number = close[0]
        again = poses[number]
        finished.add(number)
        poses[number] = examined(
            refined(again.T_design_scan, again.facing, scan.every, settings.max_iterations)
        )
        poses = scored(poses, inlier)
    order = sorted(range(len(poses)), key=lambda number: poses[number].score_mm2)
    # refined on all points, some may have come to be one
    best, *rivals = _apart([poses[number] for number in order], scan.few.points, APART_SHARE * diagonal)
    return Searched(best, tuple(rivals), sources[order[0]])


def scored(poses: list[Pose], inlier_distance_mm: float) -> list[Pose]:
    """What each hides more, and covers less, than the best of them in that, counts as lying at the inlier distance."""
    least_hidden = min(pose.hidden_share for pose in poses)
    most_covered = max(pose.coverage for pose in poses)

    def score_mm2(pose: Pose) -> float:
        hidden = max(0.0, pose.hidden_share - least_hidden - ALIKE)
        uncovered = max(0.0, most_covered - pose.coverage - ALIKE)
        return pose.cost_mm2 + (hidden + uncovered) * inlier_distance_mm**2

    return [replace(pose, score_mm2=score_mm2(pose)) for pose in poses]


def _apart(poses: list[Pose], points: FloatArray, apart_mm: float) -> list[Pose]:
    """Of poses that came to be one, the first."""
    kept: list[Pose] = []
    for pose in poses:
        if all(
            rigid.rms_displacement(pose.T_design_scan, each.T_design_scan, points) > apart_mm for each in kept
        ):
            kept.append(pose)
    return kept


def _seeds(matching: Matching, points: ScanPoints, design: Surface, inlier_distance_mm: float) -> list[Seed]:
    """The fit of the matched landmarks, or the best hypothesis where that lies clearly better; then its rivals."""
    first, *others = matching.hypotheses
    seeds = [Seed(first.T_design_scan, first.facing, first.source)]
    if matching.T_landmarks is not None:
        by_landmarks = points.left(matching.T_landmarks, design, inlier_distance_mm).cost_mm2
        if by_landmarks <= 2 * points.left(first.T_design_scan, design, inlier_distance_mm).cost_mm2:
            seeds = [Seed(matching.T_landmarks, first.facing, "landmarks")]
    worst = RIVAL_COST * max(first.cost_mm2, 1e-12 * design.mesh.diagonal_mm**2)
    seeds += [
        Seed(rival.T_design_scan, rival.facing, rival.source) for rival in others if rival.cost_mm2 <= worst
    ]
    return seeds[: 1 + MAX_RIVALS]
