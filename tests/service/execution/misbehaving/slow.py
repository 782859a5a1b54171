"""Works, with progress, until the file go appears in its folder."""

import time
from pathlib import Path


def preload() -> None:
    """Nothing to import."""


def needs_processes(task) -> bool:
    return False


def run(task, on_progress) -> None:
    on_progress("load", 1.0, "reading")
    on_progress("clean", 10.0, "cleaning")
    while not Path(task["folder"], "go").exists():
        time.sleep(0.01)
    on_progress("report", 99.0, "writing")
