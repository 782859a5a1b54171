"""Stands for a system that has no room for another process: every other fork of the zygote is refused."""

import errno
import itertools
import os
from pathlib import Path

_forks = itertools.count()
_fork = os.fork


def preload() -> None:
    os.fork = refused


def refused() -> int:
    if next(_forks) % 2 == 0 or os.environ.get("OMP_TEST_REFUSE") == "always":
        raise BlockingIOError(errno.EAGAIN, "Resource temporarily unavailable")
    return _fork()


def needs_processes(task) -> bool:
    return False


def run(task, on_progress) -> None:
    while not Path(task["folder"], "go").exists():
        os.sched_yield()
