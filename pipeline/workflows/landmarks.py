"""Segments and landmarks of one mesh: see `pipeline.find_landmarks`."""

from pathlib import Path

from pipeline.analysis.inputs import read_mesh
from pipeline.analysis.mesh_analysis import Scales, analyse_mesh
from pipeline.core import timing
from pipeline.core.mesh_file import MeshFile
from pipeline.core.progress import OnProgress
from pipeline.core.report_header import ReportHeader
from pipeline.core.results import LandmarksOfMesh, LandmarksResult, SegmentsOfMesh
from pipeline.core.settings import Settings
from pipeline.core.timing import StageTimer
from pipeline.report.artifacts import write_landmarks
from pipeline.workflows.mesh_records import analysis_segments, landmark_records, landmark_warnings
from pipeline.workflows.provenance import one_provenance
from pipeline.workflows.publish import publish


def run_landmarks(
    file: MeshFile,
    *,
    settings: Settings,
    seed: int,
    out: Path | None,
    on_progress: OnProgress,
    header: ReportHeader | None = None,
) -> LandmarksResult:
    """See `pipeline.find_landmarks`."""
    timer = StageTimer(on_progress, timing.LANDMARKS)
    source = read_mesh(file, "mesh", settings, timer, needs_surface=True)
    mesh = source.mesh
    analysis = analyse_mesh(mesh, "mesh", Scales.of(mesh, settings), settings, timer, seed)
    landmarks, brep = landmark_records(analysis), source.brep_faces()
    result = LandmarksResult(
        segments=SegmentsOfMesh(mesh=analysis_segments(analysis, settings, brep)),
        landmarks=LandmarksOfMesh(mesh=landmarks),
        provenance=one_provenance(source.record(), settings, seed),
        timings_s={},
        files=[],
        warnings=[*analysis.warnings, *landmark_warnings(mesh=landmarks), *source.warnings()],
    )
    named = (header or ReportHeader()).of_files(mesh=file.filename)
    return publish(
        *(result, out, settings, timer),
        lambda folder, built: write_landmarks(folder, built, analysis, settings, brep, named),
    )
