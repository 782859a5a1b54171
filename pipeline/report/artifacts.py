"""The files of a job, beside results.json: meshes, tables, drawings and the report, from what the stages
computed.

Each `write_*` function writes into an existing folder and returns the names that it wrote.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pipeline.analysis.design_model import DesignModel
from pipeline.analysis.mesh_analysis import Analysis, SegmentationResult
from pipeline.core.brep_faces import BrepFaces
from pipeline.core.mesh import Mesh
from pipeline.core.report_header import ReportHeader
from pipeline.core.results import LandmarksResult, Note, RegistrationResult, StudyResult
from pipeline.core.settings import ReportSettings, Settings
from pipeline.report import decision_graph, deviation_histogram, glb, page, palette, pdf, three_mf, writers
from pipeline.report.colormap import ColourScale
from pipeline.report.glb import DisplayMesh
from pipeline.report.page import NO_HEADER
from pipeline.report.registration_pictures import (
    SEGMENTS_NOTE,
    colour_scale,
    registration_views,
    segment_pictures,
)
from pipeline.report.sections import Pictures
from pipeline.report.views import standard_views
from pipeline.report.words import ENGLISH, Words
from pipeline.stages.deviation import Deviations
from pipeline.stages.segmentation import Segmentation

PAGE = "report.html"
ALIGNED_3MF = "aligned.3mf"


@dataclass(frozen=True, slots=True)
class Artifacts:
    """files : names of what was written; notes : why something that was asked for was not"""

    files: tuple[str, ...] = ()
    notes: tuple[Note, ...] = ()

    def __add__(self, other: "Artifacts") -> "Artifacts":
        return Artifacts((*self.files, *other.files), (*self.notes, *other.notes))


def write_registration(
    out: Path,
    result: RegistrationResult,
    design: DesignModel,
    scan: Analysis,
    deviations: Deviations,
    settings: Settings,
    header: ReportHeader = NO_HEADER,
) -> Artifacts:
    """The files of a registration that `settings.report` asks for. scan : in mm, in its own frame"""
    design_display, scan_display = display_mesh(design.analysis), display_mesh(scan)
    if result.transform is not None:
        scan_display = scan_display.moved(np.array(result.transform.matrix))
    scale = colour_scale(deviations.summary, result.scan, design.diagonal_mm)
    words = Words(settings.report.language)
    landmarks = {"design": result.landmarks.design, "scan": result.landmarks.scan}
    writers.write_landmarks(out / "landmarks.csv", landmarks, result.landmarks.matches)
    files = ["landmarks.csv"]
    if result.inspection is not None and result.inspection.checks:
        writers.write_characteristics(out / "characteristics.csv", result.inspection.checks, result.reference)
        files.append("characteristics.csv")
    if result.transform is not None:
        writers.write_mesh(out / "aligned.ply", scan_display.full)
        files += [
            "aligned.ply",
            *_write_deviation(out, scan_display, deviations, scale, settings.report, words),
        ]
    artifacts = Artifacts(tuple(files))
    if settings.report.is_full:
        files = write_design(out, design, design_display, settings)
        files += write_analysis(out, "scan", scan, settings, words=words)
        views = registration_views(
            result, design.analysis, design_display, scan, scan_display, deviations, words
        )
        text = page.registration(result, views, out, header, words, summary=settings.report.summary)
        artifacts += Artifacts(tuple(files)) + _write_page(out, text, settings.report)
    if result.transform is not None and settings.report.three_mf:
        artifacts += _write_three_mf(out, scan_display.full, deviations, scale)
    return artifacts


def write_design(out: Path, design: DesignModel, display: DisplayMesh, settings: Settings) -> list[str]:
    """The files that are the design's alone, from the model where it holds them; those that it keeps are
    English.
    """
    analysis, files = design.analysis, design.cached.files
    if not files:
        names = [*write_analysis(out, "design", analysis, settings, design.cached.brep), "design.glb"]
        colours = palette.of_clean_vertices(analysis.segmentation, analysis.resampled)
        landmarks_mm = analysis.mesh.vertices[analysis.landmark_vertices]
        glb.write_glb(out / "design.glb", display, colours, landmarks_mm)
        files = {name: (out / name).read_bytes() for name in names}
        design.keep_files(files)
    else:
        for name, content in files.items():
            (out / name).write_bytes(content)
    words = Words(settings.report.language)
    if words != ENGLISH:
        _write_graph(out, "design", analysis.segmentation, settings, words)
    return list(files)


def write_segments(out: Path, mesh: Mesh, segments: SegmentationResult, settings: Settings) -> Artifacts:
    """The files of `find_segments`. mesh : the cleaned mesh"""
    segmentation, resampled = segments.segmentation, segments.resampled
    writers.write_mesh(out / "mesh.segments.ply", mesh, palette.of_clean_vertices(segmentation, resampled))
    if not settings.report.is_full:
        return Artifacts(("mesh.segments.ply",))
    writers.write_vertices(out / "mesh.vertices.csv", mesh, resampled.working_of_clean, segmentation)
    _write_graph(out, "mesh", segmentation, settings, Words(settings.report.language))
    return Artifacts(("mesh.segments.ply", "mesh.vertices.csv", "mesh.decision_graph.svg"))


def write_landmarks(
    out: Path,
    result: LandmarksResult,
    analysis: Analysis,
    settings: Settings,
    brep: BrepFaces | None = None,
    header: ReportHeader = NO_HEADER,
) -> Artifacts:
    """The files of a landmarks job. brep : faces of the CAD model, where the file has them"""
    colours = palette.of_clean_vertices(analysis.segmentation, analysis.resampled)
    writers.write_mesh(out / "mesh.segments.ply", analysis.mesh, colours)
    writers.write_landmarks(out / "landmarks.csv", {"mesh": result.landmarks.mesh})
    if not settings.report.is_full:
        return Artifacts(("mesh.segments.ply", "landmarks.csv"))
    words, mesh = Words(settings.report.language), analysis.mesh
    files = write_analysis(out, "mesh", analysis, settings, brep, words)
    names = standard_views(mesh)
    images = segment_pictures(words("mesh"), analysis, display_mesh(analysis), mesh, names, words)
    title = words("Segments and landmarks")
    pictures = Pictures(title, words("segments,"), images, words(SEGMENTS_NOTE))
    text = page.landmarks(result, pictures, out, header, words)
    return Artifacts((*files, "mesh.segments.ply", "landmarks.csv")) + _write_page(out, text, settings.report)


def write_study_page(
    out: Path, result: StudyResult, summary: str, settings: Settings, header: ReportHeader = NO_HEADER
) -> Artifacts:
    """The report of a study, whose trials and picture lie in `out`. summary : in its language"""
    if not settings.report.is_full:
        return Artifacts()
    words = Words(settings.report.language)
    return _write_page(out, page.study(result, summary, out, header, words), settings.report)


def write_analysis(
    out: Path,
    name: str,
    analysis: Analysis,
    settings: Settings,
    brep: BrepFaces | None = None,
    words: Words = ENGLISH,
) -> list[str]:
    """`<name>.clean.ply`, `.vertices.csv`, `.decision_graph.svg`, and `.brep_faces.csv` of a CAD model."""
    writers.write_mesh(out / f"{name}.clean.ply", analysis.mesh)
    writers.write_vertices(
        *(out / f"{name}.vertices.csv", analysis.mesh, analysis.resampled.working_of_clean),
        *(analysis.segmentation, analysis.landmarks.t2_all, analysis.landmark_vertices),
    )
    graph = _write_graph(out, name, analysis.segmentation, settings, words)
    files = [f"{name}.clean.ply", f"{name}.vertices.csv", graph]
    if brep is not None:
        files.append(f"{name}.brep_faces.csv")
        writers.write_brep_faces(out / files[-1], analysis.mesh, brep, analysis.segment_of_faces())
    return files


def _write_graph(out: Path, name: str, segmentation: Segmentation, settings: Settings, words: Words) -> str:
    """The decision graph; its name."""
    path = out / f"{name}.decision_graph.svg"
    decision_graph.write(path, name, segmentation, settings.segmentation, words)
    return path.name


def display_mesh(analysis: Analysis) -> DisplayMesh:
    """The cleaned mesh for viewers."""
    return DisplayMesh(analysis.mesh, analysis.resampled.light)


def _write_deviation(
    out: Path,
    aligned: DisplayMesh,
    deviations: Deviations,
    scale: ColourScale,
    settings: ReportSettings,
    words: Words,
) -> list[str]:
    """The aligned scan in the colours of its deviation, and the histogram; nothing where no vertex is
    counted.
    """
    if deviations.summary is None:
        return []
    mesh = aligned.full
    colours = scale.colours(deviations.signed_mm, deviations.counted)
    writers.write_mesh(out / "deviation.ply", mesh, colours)
    if not settings.is_full:
        return ["deviation.ply"]
    counted_mm = np.where(deviations.counted, deviations.signed_mm, np.nan)
    glb.write_glb(out / "deviation.glb", aligned, colours, deviation_mm=counted_mm)
    weights = mesh.weights() * deviations.counted
    deviation_histogram.write(
        out / "deviation_histogram.svg", deviations.signed_mm, weights, deviations.summary, scale, words
    )
    return ["deviation.ply", "deviation.glb", "deviation_histogram.svg"]


def _write_page(out: Path, text: str, settings: ReportSettings) -> Artifacts:
    (out / PAGE).write_text(text, encoding="utf-8")
    if not settings.pdf:
        return Artifacts((PAGE,))
    notes = pdf.write(out / PAGE, out / pdf.NAME)
    return Artifacts((PAGE,), tuple(notes)) if notes else Artifacts((PAGE, pdf.NAME))


def _write_three_mf(out: Path, aligned: Mesh, deviations: Deviations, scale: ColourScale) -> Artifacts:
    if aligned.is_cloud:
        detail = (
            f"{ALIGNED_3MF} was not written: the scan is a point cloud, and 3MF holds triangles only; "
            "see aligned.ply"
        )
        return Artifacts(notes=(Note(code="no_three_mf", detail=detail),))
    colours = scale.colours(deviations.signed_mm, deviations.counted)
    three_mf.write(out / ALIGNED_3MF, aligned, colours, "aligned scan")
    return Artifacts((ALIGNED_3MF,))
