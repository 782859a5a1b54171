"""Time and progress around each stage, so that the stages know of neither."""

import time
from collections.abc import Iterator
from contextlib import contextmanager

from pipeline.progress import OnProgress, Progress, Stage

# Share of a registration job's time, in percent, measured on arches; both meshes together where there are two.
SHARES = {
    Stage.LOAD: 3,
    Stage.CLEAN: 4,
    Stage.RESAMPLE: 12,
    Stage.GEODESICS: 8,
    Stage.SEGMENTATION: 10,
    Stage.FEATURES: 6,
    Stage.LANDMARKS: 3,
    Stage.MATCHING: 26,
    Stage.REGISTRATION: 18,
    Stage.DEVIATION: 4,
    Stage.REPORT: 6,
}
_A_MESH = (
    *(Stage.LOAD, Stage.CLEAN, Stage.RESAMPLE, Stage.GEODESICS),
    *(Stage.SEGMENTATION, Stage.FEATURES, Stage.LANDMARKS),
)


class Watch:
    """`with watch.stage(Stage.LOAD, "design"):` announces the stage, times it, and moves the percentage on."""

    def __init__(self, on_progress: OnProgress) -> None:
        self._on_progress = on_progress
        self._done = 0.0
        self._seconds: dict[Stage, float] = {}

    @contextmanager
    def stage(self, stage: Stage, mesh: str | None = None) -> Iterator[None]:
        message = f"{stage.value}: {mesh}" if mesh else stage.value
        self._on_progress(Progress(stage, self._done, message))
        start = time.perf_counter()
        try:
            yield
        finally:
            self._seconds[stage] = self._seconds.get(stage, 0.0) + time.perf_counter() - start
        self._done = min(100.0, self._done + SHARES[stage] / (2 if stage in _A_MESH else 1))

    def timings_s(self) -> dict[str, float]:
        """Seconds by stage, both meshes together, in the order the stages ran."""
        return {stage.value: round(seconds, 4) for stage, seconds in self._seconds.items()}
