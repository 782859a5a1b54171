"""What a caller hears while the method runs: which stage, on which mesh, how far."""

from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum


class Stage(StrEnum):
    """The one vocabulary: file in `stages/`, section of `Settings`, key of `timings_s`, word a client polls."""

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
    STUDY = "study"
    REPORT = "report"


@dataclass(frozen=True, slots=True)
class Progress:
    """One step forward: `percent` of the whole job, 0 to 100, never falling."""

    stage: Stage
    percent: float
    message: str


OnProgress = Callable[[Progress], None]


def ignore(_: Progress) -> None:
    """Listener for callers that do not watch."""
