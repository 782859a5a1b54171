"""The computation of a job in its child process: the only place in the service that calls the pipeline to
compute.

`Sandbox(target=...)` names this module; tests name others, with the same three functions.
"""

from base64 import b64decode
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pipeline


def preload() -> None:
    """Import once, in the zygote, the libraries that every job needs."""
    pipeline.preload()


def needs_processes(task: dict[str, Any]) -> bool:
    """True if reading a mesh of the task takes a second process: that of Open CASCADE, for STEP.

    Called before the process is confined, and therefore looks only at the first bytes of a file.
    """
    meshes = [task[name] for name in ("design", "scan", "mesh") if name in task]
    return any(_is_step(Path(each["path"])) for each in meshes)


def _is_step(path: Path) -> bool:
    with path.open("rb") as file:
        head = file.read(pipeline.HEAD_BYTES)
    try:
        return pipeline.detect_format(head, path.stat().st_size) is pipeline.Format.STEP
    except pipeline.PipelineError:
        return False  # `run` says what is wrong with the file


def run(task: dict[str, Any], on_progress: Callable[[str, float, str], None]) -> None:
    """Run the job of type `task["type"]`; write results.json and its files to `task["out"]`."""
    common: dict[str, Any] = {
        "settings": pipeline.Settings.model_validate(task["settings"]),
        "seed": task["seed"],
        "out": task["out"],
        "header": _header(task.get("report")),
        "on_progress": lambda progress: on_progress(progress.stage.value, progress.percent, progress.message),
    }
    match task["type"]:
        case "registration":
            design, scan = _mesh(task["design"]), _mesh(task["scan"])
            own: dict[str, Any] = {
                name: task[name] for name in ("tolerance_mm", "scan_accuracy_mm", "design_cache")
            }
            acceptance, reference, alignment = (
                task[name] for name in ("acceptance", "reference", "alignment")
            )
            own |= {
                "acceptance": acceptance and pipeline.Acceptance.model_validate(acceptance),
                "reference": reference and pipeline.Reference.model_validate(reference),
                "alignment": alignment and pipeline.parse_alignment(alignment),
            }
            pipeline.register(design, scan, **own, **common)
        case "landmarks":
            pipeline.find_landmarks(_mesh(task["mesh"]), **common)
        case "study":
            pipeline.study(_mesh(task["mesh"]), **common)
        case other:
            raise ValueError(f"a job of type {other!r} was accepted, but is not implemented")


def _header(stated: dict[str, Any] | None) -> pipeline.ReportHeader | None:
    if stated is None:
        return None
    logo = stated["logo"]
    return pipeline.ReportHeader(
        job=stated["job"],
        created=stated["created"],
        company=stated["company"],
        logo=logo and b64decode(logo),
    )


def _mesh(source: dict[str, Any]) -> pipeline.MeshFile:
    return pipeline.MeshFile(
        Path(source["path"]),
        unit=source["unit"],
        filename=source["filename"],
        part=source.get("part"),
        columns=source.get("columns"),
    )
