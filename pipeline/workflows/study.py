"""A study of landmark detectors on one mesh: see `pipeline.study`."""

from pathlib import Path

from pipeline.analysis.inputs import read_mesh
from pipeline.core import timing
from pipeline.core.mesh_file import MeshFile
from pipeline.core.progress import OnProgress, Stage
from pipeline.core.report_header import ReportHeader
from pipeline.core.results import StudyResult
from pipeline.core.settings import Settings
from pipeline.core.timing import StageTimer
from pipeline.report.artifacts import Artifacts, write_study_page
from pipeline.report.words import ENGLISH, Words
from pipeline.studies.detector_study import study
from pipeline.workflows.provenance import one_provenance
from pipeline.workflows.publish import publish


def run_study(
    file: MeshFile,
    *,
    settings: Settings,
    seed: int,
    out: Path | None,
    on_progress: OnProgress,
    header: ReportHeader | None = None,
) -> StudyResult:
    """See `pipeline.study`."""
    timer = StageTimer(on_progress, timing.STUDY)
    source = read_mesh(file, "mesh", settings, timer, needs_surface=True)
    with timer.stage(Stage.STUDY):
        outcome = study(
            source.mesh, settings, seed, lambda share, message: timer.within(Stage.STUDY, share, message)
        )
    result = StudyResult(
        protocol=outcome.protocol,
        informativeness=outcome.informativeness,
        repeatability=outcome.repeatability,
        summary=outcome.summarize(ENGLISH),
        provenance=one_provenance(source.record(), settings, seed),
        timings_s={},
        files=[],
        warnings=[*outcome.warnings, *source.warnings()],
    )

    def write(folder: Path, built: StudyResult) -> Artifacts:
        words = Words(settings.report.language)
        outcome.write(folder, words)
        named = (header or ReportHeader()).of_files(mesh=file.filename)
        return Artifacts(("trials.csv", "study.svg")) + write_study_page(
            folder, built, outcome.summarize(words), settings, named
        )

    return publish(result, out, settings, timer, write)
