"""From hypotheses to the pose: trials on few points, scores, then ICP to convergence on all points.

The score of a pose is the mean squared distance of the scan to the design, truncated at the inlier distance,
plus two penalties for what distances cannot tell: the share of the scan that the design would hide from every
view, and the share of the design that the scan covers under another pose and not under this one. Both count
as that share of the points lying at the inlier distance.
"""

from dataclasses import dataclass, replace

import numpy as np

from pipeline.core.mesh import FloatArray
from pipeline.core.settings import RegistrationSettings
from pipeline.kernels import icp, rigid
from pipeline.kernels.surface import Surface
from pipeline.kernels.visibility import MAX_HIDDEN_OF_RIGHT, LinesOfSight, ViewModel
from pipeline.search.scan_model import ScanModel, ScanPoints
from pipeline.search.schedule import REGISTRATION
from pipeline.search.score_ratio import required_ratio, score_ratio
from pipeline.search.types import Matching, Pose


@dataclass(frozen=True, slots=True)
class SearchResult:
    """best : the final pose; alternatives : other distinct poses, by score; source : what the best started
    from, `landmarks`, `dense` or `axes`; ignored_stations : whether the file says where the scanner
    stood, and every pose contradicts it, so that it was not used
    """

    best: Pose
    alternatives: tuple[Pose, ...]
    source: str
    ignored_stations: bool = False


@dataclass(frozen=True, slots=True)
class Seed:
    """Where an ICP starts."""

    T_design_scan: FloatArray
    normal_sign: float
    source: str


def search_pose(
    scan: ScanModel,
    design: Surface,
    matching: Matching,
    settings: RegistrationSettings,
    *,
    thorough: bool = True,
) -> SearchResult:
    """ICP (point to plane on the exact surface) from every seed; the lowest score is the pose.

    thorough : False tries the best few seeds and stops after the trials on few points. A scan that then lies
    far off everywhere (`early_reject_ratio`) stops there too: its ICP would drift without converging.
    """
    refiner = _Refiner(scan, design, settings)
    seeds = choose_seeds(matching, scan.coarse_samples, design, refiner.inlier_mm)
    seeds = seeds if thorough else seeds[: REGISTRATION.quick_seeds]
    tried = refiner.trials(seeds)
    poses = score_poses(refiner.assess_trials([pose for pose, _ in tried]), refiner.inlier_mm)
    if thorough and not refiner.early_reject(tried[0][0]):
        poses = refiner.finish(poses)
    order = _by_score(poses)
    # Two that were refined on all points may have converged to one.
    best, *alternatives = refiner.distinct([poses[number] for number in order])
    return SearchResult(best, tuple(alternatives), tried[order[0]][1].source, refiner.ignored_stations)


def choose_seeds(
    matching: Matching, points: ScanPoints, design: Surface, inlier_distance_mm: float
) -> list[Seed]:
    """The landmarks' own fit, or the best hypothesis where that fits clearly better; then the other
    hypotheses.
    """
    first, *others = matching.hypotheses
    seeds = [Seed(first.T_design_scan, first.normal_sign, first.source)]
    if matching.T_landmarks is not None:
        by_landmarks = points.evaluate(matching.T_landmarks, design, inlier_distance_mm).cost_mm2
        by_first = points.evaluate(first.T_design_scan, design, inlier_distance_mm).cost_mm2
        if by_landmarks <= REGISTRATION.landmark_cost_ratio * by_first:
            seeds = [Seed(matching.T_landmarks, first.normal_sign, "landmarks")]
    floor_mm2 = REGISTRATION.min_cost_share_sq * design.mesh.diagonal_mm**2
    max_cost_mm2 = REGISTRATION.alternative_cost_ratio * max(first.cost_mm2, floor_mm2)
    seeds += [
        Seed(each.T_design_scan, each.normal_sign, each.source)
        for each in others
        if each.cost_mm2 <= max_cost_mm2
    ]
    return seeds[: 1 + REGISTRATION.max_alternatives]


def score_poses(poses: list[Pose], inlier_distance_mm: float) -> list[Pose]:
    """The same poses with their scores. A penalty counts what a pose hides more, or covers less, than the
    best of them in that, beyond `tie_tolerance`.
    """
    min_occlusion = min(pose.occlusion_ratio for pose in poses)
    max_coverage = max(pose.coverage for pose in poses)

    def score_mm2(pose: Pose) -> float:
        hidden = max(0.0, pose.occlusion_ratio - min_occlusion - REGISTRATION.tie_tolerance)
        uncovered = max(0.0, max_coverage - pose.coverage - REGISTRATION.tie_tolerance)
        return pose.cost_mm2 + (hidden + uncovered) * inlier_distance_mm**2

    return [replace(pose, score_mm2=score_mm2(pose)) for pose in poses]


class _Refiner:
    """The steps of the search on one scan and one design."""

    def __init__(self, scan: ScanModel, design: Surface, settings: RegistrationSettings) -> None:
        self._scan, self._design, self._settings = scan, design, settings
        self._diagonal_mm = design.mesh.diagonal_mm
        self.inlier_mm = settings.inlier_distance_mm(self._diagonal_mm)
        self._sight = scan.lines_of_sight
        self.ignored_stations = False

    def trials(self, seeds: list[Seed]) -> list[tuple[Pose, Seed]]:
        """A short ICP on few points from each seed; the distinct poses, lowest cost first."""
        iterations = min(self._settings.max_iterations, REGISTRATION.trial_iterations)
        samples = self._scan.coarse_samples
        T, normal_sign = (
            np.array([seed.T_design_scan for seed in seeds]),
            np.array([seed.normal_sign for seed in seeds]),
        )
        tried = list(zip(self._refine(T, normal_sign, samples, iterations), seeds, strict=True))
        # sorted() is stable: of equal poses the earlier hypothesis comes first
        tried = sorted(tried, key=lambda pair: pair[0].cost_mm2)
        kept = self.distinct([pose for pose, _ in tried])
        return [(pose, seed) for pose, seed in tried if any(pose is each for each in kept)]

    def early_reject(self, best: Pose) -> bool:
        """Whether even the best trial lies too far off for this part."""
        limit_mm = REGISTRATION.early_reject_ratio * self._settings.residual_limit_mm(self._diagonal_mm)
        return best.cost_mm2 > limit_mm**2

    def finish(self, poses: list[Pose]) -> list[Pose]:
        """ICP on all points, best pose first. The order may change, so it goes on until the best pose is
        finished, and those whose score comes near it.
        """
        finished: set[int] = set()
        while (number := self._next_to_finish(poses, finished)) is not None:
            finished.add(number)
            pose, samples = poses[number], self._scan.fine_samples
            (again,) = self._refine(
                *(pose.T_design_scan[None], np.array([pose.normal_sign]), samples),
                self._settings.max_iterations,
            )
            poses = score_poses(
                [self.assess(again) if k == number else each for k, each in enumerate(poses)], self.inlier_mm
            )
        return poses

    def _next_to_finish(self, poses: list[Pose], finished: set[int]) -> int | None:
        number, *others = _by_score(poses)
        if number not in finished:
            return number
        if len(finished) > REGISTRATION.max_finished:
            return None
        best = poses[number]
        # The verdict evaluates every vertex and may find a slightly larger RMS: hence the margin on both.
        margin, rms_mm = REGISTRATION.refine_margin, float(np.sqrt(best.cost_mm2))
        required = margin * required_ratio(margin * rms_mm, self._diagonal_mm, self._settings)
        close = (
            other
            for other in others
            if other not in finished
            and score_ratio(poses[other].score_mm2, best.score_mm2, self._diagonal_mm) < required
        )
        return next(close, None)

    def assess_trials(self, poses: list[Pose]) -> list[Pose]:
        """`assess` of each, without the stations of the scanner where every pose contradicts them."""
        assessed = [self.assess(pose) for pose in poses]
        if self._sight is None or min(pose.occlusion_ratio for pose in assessed) <= MAX_HIDDEN_OF_RIGHT:
            return assessed
        self._sight, self.ignored_stations = None, True
        return [replace(pose, occlusion_ratio=0.0) for pose in assessed]

    def assess(self, pose: Pose) -> Pose:
        """The pose with its cost on all points, its occlusion ratio and its coverage."""
        T, sign = pose.T_design_scan, pose.normal_sign
        views: LinesOfSight | ViewModel | None = self._sight or self._scan.views(sign)
        cost = self._scan.fine_samples.evaluate(T, self._design, self.inlier_mm)
        return replace(
            pose,
            cost_mm2=cost.cost_mm2,
            rmse_mm=cost.rmse_mm,
            occlusion_ratio=0.0 if views is None else views.occlusion_ratio(T, self._design, self.inlier_mm),
            coverage=self._scan.coverage(T, sign, self._design, self.inlier_mm),
        )

    def distinct(self, poses: list[Pose]) -> list[Pose]:
        """Of poses that coincide, the first. Poses of different normal signs do so only where they are one:
        a thin wall has two sides.
        """
        points = self._scan.coarse_samples.points
        apart_mm = REGISTRATION.distinct_share * self._diagonal_mm
        one_pose_mm = REGISTRATION.one_pose_share * self._diagonal_mm

        def coincide(pose: Pose, other: Pose) -> bool:
            limit_mm = apart_mm if pose.normal_sign == other.normal_sign else one_pose_mm
            return rigid.rms_displacement(pose.T_design_scan, other.T_design_scan, points) <= limit_mm

        kept: list[Pose] = []
        for pose in poses:
            if not any(coincide(pose, each) for each in kept):
                kept.append(pose)
        return kept

    def _refine(
        self, T: FloatArray, normal_sign: FloatArray, points: ScanPoints, max_iterations: int
    ) -> list[Pose]:
        """ICP from each T (h, 4, 4) with its normal_sign (h,)."""
        refined = icp.refine_all(
            *(points.points, points.normals, points.weights, self._design, T, normal_sign),
            max_distance_mm=self.inlier_mm,
            max_iterations=max_iterations,
            tolerance_mm=REGISTRATION.convergence_share * self._diagonal_mm,
        )
        costs = [points.evaluate(each.T_target_source, self._design, self.inlier_mm) for each in refined]
        return [
            Pose(
                *(each.T_target_source, cost.cost_mm2, cost.rmse_mm, each.converged, each.iterations),
                normal_sign=float(sign),
            )
            for each, cost, sign in zip(refined, costs, normal_sign, strict=True)
        ]


def _by_score(poses: list[Pose]) -> list[int]:
    """Indices of poses, lowest score first; ties by index."""
    return sorted(range(len(poses)), key=lambda number: poses[number].score_mm2)
