"""Segments of one mesh, without landmarks: see `pipeline.find_segments`."""

from pathlib import Path

from pipeline.analysis.inputs import read_mesh
from pipeline.analysis.mesh_analysis import Scales, segment_mesh
from pipeline.core import timing
from pipeline.core.mesh_file import MeshFile
from pipeline.core.progress import OnProgress
from pipeline.core.results import SegmentsOfMesh, SegmentsResult
from pipeline.core.settings import Settings
from pipeline.core.timing import StageTimer
from pipeline.report.artifacts import write_segments
from pipeline.workflows.mesh_records import segments_record
from pipeline.workflows.provenance import one_provenance
from pipeline.workflows.publish import publish


def run_segments(
    file: MeshFile, *, settings: Settings, seed: int, out: Path | None, on_progress: OnProgress
) -> SegmentsResult:
    """See `pipeline.find_segments`."""
    timer = StageTimer(on_progress, timing.SEGMENTS)
    source = read_mesh(file, "mesh", settings, timer, needs_surface=True)
    mesh = source.mesh
    segments = segment_mesh(mesh, "mesh", Scales.of(mesh, settings), settings, timer, seed)
    record = segments_record(mesh, segments.resampled, segments.segmentation, settings, limit_share=None)
    result = SegmentsResult(
        segments=SegmentsOfMesh(mesh=record),
        provenance=one_provenance(source.record(), settings, seed),
        timings_s={},
        files=[],
        warnings=[*segments.distances.warnings, *source.warnings()],
    )
    return publish(
        result, out, settings, timer, lambda folder, _: write_segments(folder, mesh, segments, settings)
    )
