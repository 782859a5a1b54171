"""What a job leaves to look at: coloured meshes, drawings, and the report, from what the stages found."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pipeline.analysis.design_model import Design
from pipeline.analysis.mesh_analysis import Analysis
from pipeline.core.mesh import FloatArray, Mesh
from pipeline.core.results import LandmarksResult, Note, RegistrationResult, StudyResult
from pipeline.core.settings import ReportSettings
from pipeline.report import deviation_histogram, three_mf
from pipeline.report import glb as viewing
from pipeline.report import page as report_page
from pipeline.report import pdf as report_pdf
from pipeline.report import writers as report
from pipeline.report.colormap import ColourScale
from pipeline.report.glb import DisplayMesh
from pipeline.report.page import PageViews, render_views
from pipeline.report.sections import Pictures
from pipeline.report.sections import legend as deviation_legend
from pipeline.stages.deviation import Deviations

OF_DEVIATION = ("deviation.ply", "deviation.glb", "deviation_histogram.svg")
PAGE = "report.html"
ALIGNED_3MF = "aligned.3mf"
SEGMENTS_NOTE = "One colour a segment, halo paler; dots are landmarks."


@dataclass(frozen=True, slots=True)
class Written:
    """What the settings asked for beside the page. files : names; notes : why one is not among them"""

    files: tuple[str, ...] = ()
    notes: tuple[Note, ...] = ()


def write_deviation(out: Path, shown: DisplayMesh, measured: Deviations) -> list[str]:
    """The aligned scan in the colours of its deviation, and their histogram; returns the names."""
    if measured.summary is None:
        return []
    aligned = shown.full
    scale = _scale(measured)
    colours = scale.colours(measured.signed_mm, measured.counted)
    report.write_mesh(out / "deviation.ply", aligned, colours)
    counted_mm = np.where(measured.counted, measured.signed_mm, np.nan)
    viewing.write_glb(out / "deviation.glb", shown, colours, deviation_mm=counted_mm)
    weights = aligned.weights() * measured.counted
    deviation_histogram.write(
        out / "deviation_histogram.svg", measured.signed_mm, weights, measured.summary, scale
    )
    return list(OF_DEVIATION)


def write_registration_page(
    out: Path,
    result: RegistrationResult,
    design: Design,
    scan: Analysis,
    shown: DisplayMesh,
    measured: Deviations,
    settings: ReportSettings,
) -> Written:
    """The page, and what the settings ask for beside it. shown : the scan on the design; without a pose where it was"""
    aligned = None if result.transform is None else shown.full
    views = PageViews(
        placed=_placed(result, design, shown, measured),
        parts=_parts(design, scan, shown, is_aligned=aligned is not None),
        sizes=_sizes(result, design.analysis.mesh, aligned, scan.mesh),
    )
    more = _write_page(out, report_page.registration(result, views, out), settings)
    if aligned is None or not settings.three_mf:
        return more
    coloured = _write_three_mf(out, aligned, measured)
    return Written((*more.files, *coloured.files), (*more.notes, *coloured.notes))


def write_landmarks_page(
    out: Path, result: LandmarksResult, found: Analysis, settings: ReportSettings
) -> Written:
    """The page of a landmarks job."""
    views = _segments("mesh", found, found.shown(), found.mesh, count=4)
    pictures = Pictures("Segments and landmarks", "segments of the", views, SEGMENTS_NOTE)
    return _write_page(out, report_page.landmarks(result, pictures, out), settings)


def write_study_page(out: Path, result: StudyResult, settings: ReportSettings) -> Written:
    """The page of a study."""
    return _write_page(out, report_page.study(result, out), settings)


def _write_page(out: Path, text: str, settings: ReportSettings) -> Written:
    (out / PAGE).write_text(text, encoding="utf-8")
    if not settings.pdf:
        return Written()
    notes = report_pdf.write(out / PAGE, out / report_pdf.NAME)
    return Written(notes=tuple(notes)) if notes else Written(files=(report_pdf.NAME,))


def _write_three_mf(out: Path, aligned: Mesh, measured: Deviations) -> Written:
    if aligned.is_cloud:
        detail = f"{ALIGNED_3MF} was not written: the scan is points, and 3MF holds triangles; aligned.ply has them"
        return Written(notes=(Note(code="no_three_mf", detail=detail),))
    colours = _scale(measured).colours(measured.signed_mm, measured.counted)
    three_mf.write(out / ALIGNED_3MF, aligned, colours, "aligned scan")
    return Written(files=(ALIGNED_3MF,))


def _placed(
    result: RegistrationResult, design: Design, shown: DisplayMesh, measured: Deviations
) -> Pictures | None:
    """The scan where it fits, or where it fits least badly: the one shows what to mend, the other what went wrong."""
    title, note = "Deviation of the scan from the design", ""
    rejected = result.transform is None
    if rejected:
        if not result.alternatives:
            return None
        shown = shown.moved(np.array(result.alternatives[0].matrix))
        title = "Not a measurement: the best pose that was tried, and rejected"
        note = (
            "Where the scan lies on the design here, and where it does not, may tell why the two do not fit."
        )
    if measured.summary is None:
        return None
    scale = _scale(measured)
    colours = shown.values(scale.colours(measured.signed_mm, measured.counted))
    legend = deviation_legend(scale, measured.summary.sign, rejected=rejected)
    return Pictures(
        title, "distances of the scan", render_views(shown.mesh, colours, design.analysis.mesh), note, legend
    )


def _scale(measured: Deviations) -> ColourScale:
    tolerance_mm = None if measured.summary is None else measured.summary.tolerance_mm
    return ColourScale.of(measured.signed_mm, measured.counted, tolerance_mm)


def _parts(design: Design, scan: Analysis, shown: DisplayMesh, *, is_aligned: bool) -> Pictures:
    """Segments of both beside each other; with a pose from the same sides, however the scan was uploaded."""
    of_design = _segments("design", design.analysis, design.light, design.analysis.mesh, count=2)
    of_scan = _segments("scan", scan, shown, design.analysis.mesh if is_aligned else shown.full, count=2)
    beside = [each for side in zip(of_design, of_scan, strict=True) for each in side]
    note = f"{SEGMENTS_NOTE} Each mesh is numbered and coloured by itself."
    return Pictures("Segments and landmarks", "segments of the", beside, note)


def _segments(
    name: str, found: Analysis, shown: DisplayMesh, like: Mesh, count: int
) -> list[tuple[str, bytes]]:
    """shown : its mesh, in whatever frame it is to be seen"""
    marks: FloatArray = np.asarray(shown.full.vertices[found.landmark_vertices])
    views = render_views(
        shown.mesh, shown.values(found.segment_colours()), like, count=count, landmarks_mm=marks
    )
    return [(f"{name} {caption}", data) for caption, data in views]


def _sizes(result: RegistrationResult, design: Mesh, aligned: Mesh | None, scan: Mesh) -> str:
    """Extents along the axes of the design's file; without a pose those of the scan along its own file's."""
    factor = None if result.scale is None else result.scale.unit_factor
    times = "" if factor is None else f", its numbers times {factor:.4g},"
    where = "along the same axes" if aligned is not None else "along the axes of its file"
    size = _extents(scan if aligned is None else aligned)
    return f"Design {_extents(design)} along the axes of its file; scan{times} {size} {where}."


def _extents(mesh: Mesh) -> str:
    return " x ".join(f"{x:.1f}" for x in np.ptp(mesh.vertices, axis=0)) + " mm"
