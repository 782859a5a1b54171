"""The two studies on one mesh behind one function.

`informativeness` (`studies/informativeness.py`) is the paper's protocol on a shape and its own copy.
`repeatability` (`studies/repeatability.py`) measures whether a detector finds the same landmarks on another
mesh of the shape.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from pipeline.analysis.mesh_analysis import Scales, segment_mesh
from pipeline.core.errors import TooFewLandmarks
from pipeline.core.mesh import FloatArray, Mesh
from pipeline.core.results import (
    InformativenessProtocol,
    InformativenessRow,
    Note,
    RepeatabilityProtocol,
    RepeatabilityRow,
)
from pipeline.core.settings import Detector, Settings
from pipeline.core.timing import silent
from pipeline.report.words import Words
from pipeline.stages.features import features
from pipeline.stages.landmarks import landmarks
from pipeline.studies import informativeness as paper
from pipeline.studies import informativeness_summary as paper_summary
from pipeline.studies import plots
from pipeline.studies import repeatability as repeat

T2: Detector = "t2"
#: Points that determine a rigid motion (derived).
MIN_POINTS = 3

OnShare = Callable[[float, str], None]


@dataclass(frozen=True, slots=True)
class StudyOutcome:
    """Fields of `results.StudyResult`; `summarize(words)`, the summary in a language; and
    `write(folder, words)`, which writes trials.csv and study.svg.
    """

    protocol: InformativenessProtocol | RepeatabilityProtocol
    informativeness: list[InformativenessRow] | None
    repeatability: list[RepeatabilityRow] | None
    summarize: Callable[[Words], str]
    write: Callable[[Path, Words], None]
    warnings: tuple[Note, ...]


def study(mesh: Mesh, settings: Settings, seed: int, on_share: OnShare) -> StudyOutcome:
    """The study that `settings.study` describes, on the cleaned `mesh`.

    Raises
    ------
    TooFewLandmarks
        If no detector finds three points for `informativeness`.
    """
    if settings.study.kind == "repeatability":
        return _repeatability(mesh, settings, seed, on_share)
    return _informativeness(mesh, settings, seed, on_share)


def _informativeness(mesh: Mesh, settings: Settings, seed: int, on_share: OnShare) -> StudyOutcome:
    section, warnings = settings.study, []
    on_share(0.0, "landmarks")
    keypoints = _keypoints(mesh, settings, seed)
    if len(keypoints[T2]) < MIN_POINTS and not settings.landmarks.include_halo:
        # By the article's definition nearly all of an evenly triangulated arch is halo. The paper's number of
        # landmarks, 3 % of all vertices, is impossible without it.
        detail = (
            f"mesh: only {len(keypoints[T2])} landmarks lie outside the halo; the study includes the halo"
        )
        warnings.append(Note(code="halo_included", detail=detail))
        with_halo = settings.landmarks.model_copy(update={"include_halo": True})
        keypoints = _keypoints(mesh, settings.model_copy(update={"landmarks": with_halo}), seed)
    usable = {detector: points for detector, points in keypoints.items() if len(points) >= MIN_POINTS}
    usable = {detector: points for detector, points in usable.items() if detector in section.detectors}
    counts = ", ".join(f"{detector} {len(points)}" for detector, points in keypoints.items())
    if not usable:
        raise TooFewLandmarks(f"no detector found {MIN_POINTS} points ({counts})", mesh="mesh")
    if len(usable) < len(section.detectors):
        detail = f"mesh: detectors with fewer than {MIN_POINTS} points are excluded ({counts})"
        warnings.append(Note(code="too_few_landmarks", detail=detail))
    trials = section.trials or paper.DEFAULT_TRIALS
    found = paper.informativeness(
        mesh.vertices,
        usable,
        trials=trials,
        noise_mm=section.noise_mm or paper.DEFAULT_NOISE_SHARE * mesh.diagonal_mm,
        rotation_deg=section.rotation_deg,
        seed=seed,
        on_share=lambda share: on_share(share, f"trial {round(share * trials):,} of {trials:,}"),
    )
    protocol, rows = paper_summary.protocol(found), paper_summary.rows(found)

    def write(folder: Path, words: Words) -> None:
        paper_summary.write_trials(folder / "trials.csv", found)
        plots.write_informativeness(folder / "study.svg", found, words)

    def summarize(words: Words) -> str:
        return paper_summary.summarize(protocol, rows, words)

    return StudyOutcome(protocol, rows, None, summarize, write, tuple(warnings))


def _keypoints(mesh: Mesh, settings: Settings, seed: int) -> Mapping[Detector, FloatArray]:
    """(k, 3) points of t2 and of each detector that is section for, as many as `count` or as t2 gives."""
    scales = Scales.of(mesh, settings)
    found = segment_mesh(mesh, "mesh", scales, settings, silent(), seed, fine=True)
    working = found.resampled.mesh
    measured = features(found.resampled.fine or working, scales.radius_mm, settings.features)
    landmark_settings = settings.landmarks.model_copy(
        update={"count": settings.study.count or settings.landmarks.count}
    )
    return {
        detector: landmarks(
            *(working, found.distances.surface, found.segmentation, measured),
            landmark_settings.model_copy(update={"detector": detector}),
            seed,
        ).position_mm
        for detector in dict.fromkeys((T2, *settings.study.detectors))
    }


def _repeatability(mesh: Mesh, settings: Settings, seed: int, on_share: OnShare) -> StudyOutcome:
    protocol, trials = repeat.repeatability(mesh, settings, seed, on_share)
    rows = repeat.rows(trials, mesh.diagonal_mm)

    def write(folder: Path, words: Words) -> None:
        repeat.write_trials(folder / "trials.csv", trials)
        plots.write_repeatability(folder / "study.svg", protocol, rows, words)

    def summarize(words: Words) -> str:
        return repeat.summarize(protocol, rows, words)

    return StudyOutcome(protocol, None, rows, summarize, write, ())
