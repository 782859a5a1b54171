"""What a job leaves to look at: coloured meshes, drawings, and the report, from what the stages found."""

from pathlib import Path

import numpy as np

from pipeline import deviation_histogram, report_page, viewing
from pipeline.analysis import Analysis
from pipeline.colour_scale import ColourScale
from pipeline.design import Design
from pipeline.mesh import FloatArray, Mesh
from pipeline.outcome import LandmarksResult, RegistrationResult, StudyResult
from pipeline.report_page import Pictures, views_of
from pipeline.stages import report
from pipeline.stages.deviation import Deviations

OF_DEVIATION = ("deviation.ply", "deviation.glb", "deviation_histogram.svg")
PAGE = "report.html"


def write_deviation(out: Path, aligned: Mesh, measured: Deviations) -> list[str]:
    """The aligned scan in the colours of its deviation, and their histogram; returns the names."""
    if measured.summary is None:
        return []
    scale = _scale(measured)
    colours = scale.colours(measured.signed_mm, measured.counted)
    report.write_mesh(out / "deviation.ply", aligned, colours)
    counted_mm = np.where(measured.counted, measured.signed_mm, np.nan)
    viewing.write_glb(out / "deviation.glb", aligned, colours, deviation_mm=counted_mm)
    weights = aligned.weights() * measured.counted
    deviation_histogram.write(out / "deviation_histogram.svg", measured.signed_mm, weights, measured.summary, scale)
    return list(OF_DEVIATION)


def write_registration_page(
    out: Path, result: RegistrationResult, design: Design, scan: Analysis, aligned: Mesh | None, measured: Deviations
) -> None:
    """aligned : the scan on the design; None without a pose"""
    scale = None if aligned is None or measured.summary is None else _scale(measured)
    pictures = None
    if aligned is not None and scale is not None:
        shown, colours = viewing.lighter(aligned, scale.colours(measured.signed_mm, measured.counted))
        pictures = Pictures("", "deviation of the scan", views_of(shown, colours, design.analysis.mesh))
    parts = [
        _segments("Design: segments and landmarks", design.analysis),
        _segments("Scan: segments and landmarks", scan),
    ]
    page = report_page.registration(result, deviation=pictures, parts=parts, scale=scale, out=out)
    (out / PAGE).write_text(page, encoding="utf-8")


def write_landmarks_page(out: Path, result: LandmarksResult, found: Analysis) -> None:
    """The page of a landmarks job."""
    parts = [_segments("Segments and landmarks", found, count=4)]
    (out / PAGE).write_text(report_page.landmarks(result, parts, out), encoding="utf-8")


def write_study_page(out: Path, result: StudyResult) -> None:
    """The page of a study."""
    (out / PAGE).write_text(report_page.study(result, out), encoding="utf-8")


def _scale(measured: Deviations) -> ColourScale:
    tolerance_mm = None if measured.summary is None else measured.summary.tolerance_mm
    return ColourScale.of(measured.signed_mm, measured.counted, tolerance_mm)


def _segments(title: str, found: Analysis, count: int = 2) -> Pictures:
    shown, colours = viewing.lighter(found.mesh, found.segment_colours())
    marks: FloatArray = np.asarray(found.mesh.vertices[found.landmark_vertices])
    note = "One colour a segment, halo paler; dots are landmarks."
    return Pictures(title, title, views_of(shown, colours, found.mesh, count=count, marks_mm=marks), note)
