"""What a job's child process does: the only place in the service that calls the door to compute.

`Sandbox(target=...)` names this module; tests name others, with the same two functions.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pipeline


def preload() -> None:
    """Import once, in the zygote, what every job needs."""
    pipeline.preload()


def run(task: dict[str, Any], on_progress: Callable[[str, float, str], None]) -> None:
    """Register `task["scan"]` to `task["design"]`, and write results.json and the files to `task["out"]`."""
    design, scan = (
        pipeline.MeshFile(Path(mesh["path"]), unit=mesh["unit"], filename=mesh["filename"])
        for mesh in (task["design"], task["scan"])
    )
    pipeline.register(
        design,
        scan,
        settings=pipeline.Settings.model_validate(task["settings"]),
        tolerance_mm=task["tolerance_mm"],
        seed=task["seed"],
        out=task["out"],
        on_progress=lambda progress: on_progress(progress.stage.value, progress.percent, progress.message),
    )
