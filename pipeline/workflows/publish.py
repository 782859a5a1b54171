"""The last step of every workflow: make the folder, write the artifacts, then results.json, which lists
them.
"""

from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

from pipeline.core.progress import Stage
from pipeline.core.results import LandmarksResult, RegistrationResult, SegmentsResult, StudyResult
from pipeline.core.settings import Settings
from pipeline.core.timing import StageTimer
from pipeline.report.artifacts import Artifacts

R = TypeVar("R", RegistrationResult, SegmentsResult, LandmarksResult, StudyResult)
RESULTS = "results.json"


def publish(
    result: R,
    out: Path | None,
    settings: Settings,
    timer: StageTimer,
    write_artifacts: Callable[[Path, R], Artifacts],
) -> R:
    """The result with its files, timings and the warnings of the report; written to `out`, unless that is
    None.

    write_artifacts : called with the folder and the result; not called where `report` asks for no files
    """
    if out is None:
        return result.model_copy(update={"timings_s": timer.timings_s()})
    artifacts: Artifacts = Artifacts()
    with timer.stage(Stage.REPORT):
        out.mkdir(parents=True, exist_ok=True)
        if settings.report.writes_files:
            artifacts = write_artifacts(out, result)
    result = result.model_copy(
        update={
            "timings_s": timer.timings_s(),
            "files": sorted([*artifacts.files, RESULTS]),
            "warnings": [*result.warnings, *artifacts.notes],
        }
    )
    (out / RESULTS).write_text(result.model_dump_json(indent=1) + "\n", encoding="utf-8")
    return result
