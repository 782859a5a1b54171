"""Measures the time of each stage and reports the progress; the stages themselves do neither."""

import time
from collections.abc import Iterator
from contextlib import contextmanager

from pipeline.core.progress import OnProgress, Progress, Stage, ignore

# Share of a job's time of one run of each stage, percent, measured on dental arches; used only for progress
# reports. A registration runs the stages from load to matching twice, so every table sums to 100 over a job.
REGISTRATION: dict[Stage, float] = {
    Stage.LOAD: 1.5,
    Stage.CLEAN: 2,
    Stage.RESAMPLE: 6,
    Stage.GEODESICS: 4,
    Stage.SEGMENTATION: 5,
    Stage.FEATURES: 3,
    Stage.LANDMARKS: 1.5,
    Stage.MATCHING: 13,
    Stage.REGISTRATION: 18,
    Stage.DEVIATION: 3,
    Stage.INSPECTION: 1,
    Stage.REPORT: 6,
}
SEGMENTS: dict[Stage, float] = {
    Stage.LOAD: 5,
    Stage.CLEAN: 8,
    Stage.RESAMPLE: 27,
    Stage.GEODESICS: 20,
    Stage.SEGMENTATION: 25,
    Stage.REPORT: 15,
}
LANDMARKS: dict[Stage, float] = {
    Stage.LOAD: 4,
    Stage.CLEAN: 6,
    Stage.RESAMPLE: 22,
    Stage.GEODESICS: 12,
    Stage.SEGMENTATION: 26,
    Stage.FEATURES: 14,
    Stage.LANDMARKS: 6,
    Stage.REPORT: 10,
}
STUDY: dict[Stage, float] = {Stage.LOAD: 1, Stage.CLEAN: 1, Stage.STUDY: 96, Stage.REPORT: 2}


class StageTimer:
    """Reports and times the stages of one job: `with timer.stage(Stage.LOAD, "design"):`.

    shares : percent of the job per stage (REGISTRATION, SEGMENTS, LANDMARKS or STUDY); the percentage
    advances by it after each stage
    """

    def __init__(self, on_progress: OnProgress, shares: dict[Stage, float]) -> None:
        self._on_progress = on_progress
        self._shares = shares
        self._done = 0.0
        self._seconds: dict[Stage, float] = {}

    @contextmanager
    def stage(self, stage: Stage, mesh: str | None = None) -> Iterator[None]:
        """Report the start of `stage` on `mesh` ("scan", "design" or none), and measure its time."""
        message = f"{stage.value}: {mesh}" if mesh else stage.value
        self._on_progress(Progress(stage, self._done, message))
        start = time.perf_counter()
        try:
            yield
        finally:
            self._seconds[stage] = self._seconds.get(stage, 0.0) + time.perf_counter() - start
        self._done = min(100.0, self._done + self._shares[stage])

    def within(self, stage: Stage, share: float, message: str) -> None:
        """Report progress inside a long stage: `share` of it is done, in [0, 1].

        To be called inside `with self.stage(stage)`.
        """
        percent = self._done + min(max(share, 0.0), 1.0) * self._shares[stage]
        self._on_progress(Progress(stage, min(100.0, percent), f"{stage.value}: {message}"))

    def timings_s(self) -> dict[str, float]:
        """Seconds per stage, summed over both meshes, in the order of the first runs."""
        return {stage.value: round(seconds, 4) for stage, seconds in self._seconds.items()}


def silent() -> StageTimer:
    """Timer that reports nothing, for stages inside a study, which reports its progress by trials."""
    return StageTimer(ignore, dict.fromkeys(Stage, 0.0))
