"""Progress reports of a running job: the stage, the mesh, and the percentage done."""

from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum


class Stage(StrEnum):
    """Names of the stages: of files in `stages/` and sections of `Settings` (those of the method), keys of
    `timings_s`, the stage in a job's status.
    """

    LOAD = "load"
    CLEAN = "clean"
    RESAMPLE = "resample"
    GEODESICS = "geodesics"
    SEGMENTATION = "segmentation"
    FEATURES = "features"
    LANDMARKS = "landmarks"
    MATCHING = "matching"
    REGISTRATION = "registration"
    DEVIATION = "deviation"
    INSPECTION = "inspection"
    STUDY = "study"
    REPORT = "report"


@dataclass(frozen=True, slots=True)
class Progress:
    """One progress report. percent : share of the whole job, 0 to 100, not decreasing."""

    stage: Stage
    percent: float
    message: str


OnProgress = Callable[[Progress], None]


def ignore(_: Progress) -> None:
    """Progress callback that does nothing."""
