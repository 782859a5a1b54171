"""Wall and CPU seconds of a piece of work."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

Result = TypeVar("Result")


@dataclass(frozen=True, slots=True)
class Cost:
    wall_s: float
    cpu_s: float

    def __str__(self) -> str:
        return f"{self.wall_s:.3g} ({self.cpu_s:.3g})"


def timed(work: Callable[[], Result]) -> tuple[Cost, Result]:
    wall, cpu = time.perf_counter(), time.process_time()
    result = work()
    return Cost(time.perf_counter() - wall, time.process_time() - cpu), result


def median(costs: list[Cost]) -> Cost:
    return Cost(float(np.median([c.wall_s for c in costs])), float(np.median([c.cpu_s for c in costs])))
