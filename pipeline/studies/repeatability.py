"""Repeatability of landmarks: does a detector find the same points on another mesh of the same shape?

Salti, Tombari, Di Stefano, "A performance evaluation of 3D keypoint detectors" (2011): relative
repeatability at a stated eps, here with a fixed number of points.

A trial simulates a scan of the shape: randomly rotated, triangulated again, with noise, and in one
condition cropped. The whole analysis runs on both meshes. A detector gives `count` points on each, at
least `spacing` apart (> 2 eps, so a point has at most one partner).

repeatability = one-to-one pairs within eps / points that the scan contains. A detector with fewer than
`count` points is charged for the missing ones.
"""

import csv
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path

import numpy as np
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import maximum_bipartite_matching
from scipy.spatial import cKDTree

from pipeline.analysis.mesh_analysis import Scales, segment_mesh
from pipeline.core.landmark_set import LandmarkSet
from pipeline.core.mesh import BoolArray, FloatArray, Mesh
from pipeline.core.results import RepeatabilityProtocol, RepeatabilityRow
from pipeline.core.settings import Detector, Settings
from pipeline.core.timing import silent
from pipeline.kernels import rigid
from pipeline.kernels.fpfh import fpfh
from pipeline.report.words import ENGLISH, Words
from pipeline.search.types import DescribedMesh, Descriptors
from pipeline.stages.features import features
from pipeline.stages.landmarks import landmarks
from pipeline.stages.matching import match
from pipeline.studies.simulated_scan import conditions, simulate_scan
from pipeline.studies.statistics import quantiles

#: Points of each detector and trials of each condition if the settings name none. Chosen by hand.
DEFAULT_COUNT = 20
DEFAULT_TRIALS = 5
#: Min distance between the points of a detector in eps: more than 2, so a point has at most one partner
#: (derived).
SPACING_EPS = 2.5
#: Draws of random points that the chance level is averaged over. Chosen by hand.
CHANCE_DRAWS = 20
#: A pose is correct if its RMS error is below this share of the diagonal. Chosen by hand; not fitted.
RIGHT_SHARE = 0.01


@dataclass(frozen=True, slots=True)
class Trial:
    """One detector in one trial.

    repeatability, chance : in [0, 1]; points : mean number on the two meshes; visible : points that the
    scan contains; pose_error_mm : RMS, None if the points gave no pose
    """

    condition: str
    trial: int
    detector: Detector
    repeatability: float
    chance: float
    points: float
    visible: float
    pose_error_mm: float | None


@dataclass(frozen=True, slots=True)
class _Analysed:
    """Keypoints of all detectors on one mesh, and its descriptors."""

    side: DescribedMesh
    keypoints: Mapping[Detector, LandmarkSet]


def repeatability(
    mesh: Mesh, settings: Settings, seed: int, on_share: Callable[[float, str], None]
) -> tuple[RepeatabilityProtocol, list[Trial]]:
    """All trials, in order of condition, trial and detector.

    mesh : the cleaned mesh of the shape; on_share : receives the finished share and a message
    """
    section = settings.study
    diagonal = mesh.diagonal_mm
    eps_mm, count, trials = (
        section.eps * diagonal,
        section.count or DEFAULT_COUNT,
        section.trials or DEFAULT_TRIALS,
    )
    plan = conditions(None if section.noise_mm is None else section.noise_mm / diagonal)
    scales = Scales.of(mesh, settings)
    spacing_mm = max(SPACING_EPS * eps_mm, settings.landmarks.spacing_radii * scales.radius_mm)
    detectors = tuple(dict.fromkeys(section.detectors))
    whole = _analyse(mesh, detectors, count, spacing_mm, scales, settings, seed)

    done: list[Trial] = []
    for c, condition in enumerate(plan):
        for trial in range(trials):
            on_share(
                (c * trials + trial) / (len(plan) * trials),
                f"{condition.name}, trial {trial + 1} of {trials}",
            )
            rng = np.random.default_rng([seed, c, trial])
            scan, seen, T_scan_design = simulate_scan(mesh, condition, rng)
            again = _analyse(scan, detectors, count, spacing_mm, scales, settings, int(rng.integers(2**32)))
            chance = _chance_level(whole, again, seen, T_scan_design, count, eps_mm, rng)
            for detector in detectors:
                found = _compare(whole, again, detector, seen, T_scan_design, count, eps_mm)
                error = _pose_error_mm(whole, again, detector, scan, T_scan_design, scales, settings, seed)
                share, points, visible = found
                done.append(Trial(condition.name, trial, detector, share, chance, points, visible, error))
    protocol = RepeatabilityProtocol(
        trials=trials,
        eps=section.eps,
        eps_mm=eps_mm,
        count=count,
        spacing_mm=spacing_mm,
        conditions=[condition.name for condition in plan],
    )
    return protocol, done


def rows(trials: Sequence[Trial], diagonal_mm: float) -> list[RepeatabilityRow]:
    """One row for each condition and detector, in order of first occurrence."""
    found = []
    for condition, detector in dict.fromkeys((trial.condition, trial.detector) for trial in trials):
        group = [trial for trial in trials if (trial.condition, trial.detector) == (condition, detector)]
        errors = [trial.pose_error_mm for trial in group if trial.pose_error_mm is not None]
        found.append(
            RepeatabilityRow(
                detector=detector,
                condition=condition,
                repeatability=quantiles([trial.repeatability for trial in group]),
                mean=float(np.mean([trial.repeatability for trial in group])),
                chance=float(np.mean([trial.chance for trial in group])),
                points=float(np.mean([trial.points for trial in group])),
                pose_error_mm=quantiles(errors),
                pose_right=float(np.sum(np.array(errors) <= RIGHT_SHARE * diagonal_mm)) / len(group),
            )
        )
    return found


def write_trials(path: Path, trials: Sequence[Trial]) -> None:
    """Write trials.csv, one row for each condition, trial and detector; a missing pose error is empty."""
    names = [field.name for field in fields(Trial)]
    with path.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(names)
        for trial in trials:
            values = (getattr(trial, name) for name in names)
            writer.writerow(["" if value is None else value for value in values])


def summarize(
    protocol: RepeatabilityProtocol, results: Sequence[RepeatabilityRow], words: Words = ENGLISH
) -> str:
    """The paragraph of the report: repeatability by detector, the chance level, and the poses."""
    first = [row for row in results if row.condition == protocol.conditions[0]]
    best = max(first, key=lambda row: row.mean)
    worst = min(first, key=lambda row: row.mean)
    others = [row for row in results if row.detector == best.detector and row.condition != best.condition]
    harder = [
        words(
            "{mean} with {condition}", mean=words.fixed(row.mean, 2), condition=words.sentence(row.condition)
        )
        for row in others
    ]
    poses = [
        words("{detector} in {share}", detector=row.detector, share=words.percent(row.pose_right, 0))
        for row in first
    ]
    return words(
        "Repeatability of {count} points of each detector within {eps} of the diagonal ({eps_mm} mm), on a "
        "mesh with other triangles and {condition}: {listed}; the same number of random points reaches "
        "{chance} by chance. Highest: {best}{harder}; lowest: {worst}. The landmarks gave a pose within "
        "{right} of the diagonal for {poses} of {trials} trials.",
        count=protocol.count,
        eps=words.percent(protocol.eps),
        eps_mm=words.short(protocol.eps_mm),
        condition=words.sentence(best.condition),
        listed=", ".join(
            f"{row.detector} {words.fixed(row.mean, 2)}" for row in sorted(first, key=lambda row: -row.mean)
        ),
        chance=words.fixed(float(np.mean([row.chance for row in first])), 2),
        best=best.detector,
        harder=f" ({'; '.join(harder)})" if harder else "",
        worst=worst.detector,
        right=words.percent(RIGHT_SHARE, 0),
        poses=", ".join(poses),
        trials=protocol.trials,
    )


def _analyse(
    mesh: Mesh,
    detectors: Sequence[Detector],
    count: int,
    spacing_mm: float,
    scales: Scales,
    settings: Settings,
    seed: int,
) -> _Analysed:
    found = segment_mesh(mesh, "mesh", scales, settings, silent(), seed, fine=True)
    working = found.resampled.mesh
    measured = features(found.resampled.fine or working, scales.radius_mm, settings.features)
    section = settings.landmarks.model_copy(
        update={"count": count, "spacing_radii": spacing_mm / scales.radius_mm}
    )
    keypoints = {
        detector: landmarks(
            *(working, found.distances.surface, found.segmentation, measured),
            section.model_copy(update={"detector": detector}),
            seed,
        )
        for detector in detectors
    }
    support_mm = settings.matching.descriptor_radius_lengths * settings.matching.length_share * scales.size_mm
    one = next(iter(keypoints.values()))
    every, no_spread = np.arange(len(working.vertices)), np.arange(0)
    descriptors = Descriptors(every, fpfh(working, support_mm))
    return _Analysed(DescribedMesh(working, one, no_spread, descriptors), keypoints)


def _compare(
    whole: _Analysed,
    again: _Analysed,
    detector: Detector,
    seen: Callable[[FloatArray], BoolArray],
    T_scan_design: FloatArray,
    count: int,
    eps_mm: float,
) -> tuple[float, float, float]:
    """repeatability, points, visible : see `Trial`."""
    first, second = whole.keypoints[detector].position_mm, again.keypoints[detector].position_mm
    visible_area = float(
        np.average(seen(whole.side.mesh.vertices), weights=whole.side.mesh.vertex_areas_mm2())
    )
    shown = first[seen(first)]
    # missing points count as visible in proportion to the visible area
    visible = len(shown) + (count - len(first)) * visible_area
    back = rigid.transformed(rigid.inverse(T_scan_design), second)
    return pairs_within(shown, back, eps_mm) / max(visible, 1.0), (len(first) + len(second)) / 2, visible


def _chance_level(
    whole: _Analysed,
    again: _Analysed,
    seen: Callable[[FloatArray], BoolArray],
    T_scan_design: FloatArray,
    count: int,
    eps_mm: float,
    rng: np.random.Generator,
) -> float:
    """Mean repeatability of `count` area-weighted random points on each mesh, over `CHANCE_DRAWS` draws."""
    shares = []
    for _ in range(CHANCE_DRAWS):
        first, second = (_random_points(side.side.mesh, count, rng) for side in (whole, again))
        shown, back = first[seen(first)], rigid.transformed(rigid.inverse(T_scan_design), second)
        shares.append(pairs_within(shown, back, eps_mm) / max(len(shown), 1))
    return float(np.mean(shares))


def _random_points(mesh: Mesh, count: int, rng: np.random.Generator) -> FloatArray:
    areas = mesh.vertex_areas_mm2()
    return mesh.vertices[rng.choice(len(areas), min(count, len(areas)), replace=False, p=areas / areas.sum())]


def pairs_within(first: FloatArray, second: FloatArray, eps_mm: float) -> int:
    """Max number of one-to-one pairs of points (k, 3) and (m, 3) at most `eps_mm` apart."""
    if len(first) == 0 or len(second) == 0:
        return 0
    near = cKDTree(first).sparse_distance_matrix(cKDTree(second), eps_mm, output_type="coo_matrix")
    graph = csr_matrix((np.ones(len(near.row)), (near.row, near.col)), shape=(len(first), len(second)))
    return int((maximum_bipartite_matching(graph, perm_type="column") >= 0).sum())


def _pose_error_mm(
    whole: _Analysed,
    again: _Analysed,
    detector: Detector,
    scan: Mesh,
    T_scan_design: FloatArray,
    scales: Scales,
    settings: Settings,
    seed: int,
) -> float | None:
    """RMS error in mm of the pose from matched landmarks, over the scan's vertices; landmark hypotheses
    only.
    """
    design, other = (
        replace(analysed.side, landmarks=analysed.keypoints[detector]) for analysed in (whole, again)
    )
    if min(len(design.landmarks.vertex), len(other.landmarks.vertex)) < 3:
        return None
    alone = settings.matching.model_copy(update={"dense_pairs": False, "axes_poses": False})
    found = match(design, other, settings.matching.length_share * scales.size_mm, alone, seed)
    if found.T_landmarks is None or found.hypotheses[0].source != "landmarks":
        return None
    return rigid.rms_displacement(found.T_landmarks, rigid.inverse(T_scan_design), scan.vertices)
