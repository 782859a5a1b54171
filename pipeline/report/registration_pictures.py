"""The pictures of a registration's report: the scan on the design, and the segments of both."""

import numpy as np

from pipeline.analysis.mesh_analysis import Analysis
from pipeline.core.mesh import FloatArray, Mesh
from pipeline.core.results import Deviation, RegistrationResult, ScanQuality
from pipeline.report import palette
from pipeline.report.colormap import ColourScale, resolution_mm
from pipeline.report.glb import DisplayMesh
from pipeline.report.page import PageViews, render_views
from pipeline.report.sections import Pictures
from pipeline.report.sections import legend as deviation_legend
from pipeline.stages.deviation import Deviations

SEGMENTS_NOTE = "One colour a segment, halo paler; dots are landmarks."


def registration_views(
    result: RegistrationResult,
    design: Analysis,
    design_display: DisplayMesh,
    scan: Analysis,
    scan_display: DisplayMesh,
    deviations: Deviations,
) -> PageViews:
    """scan_display : in the design's frame where there is a pose, else in its own"""
    has_pose = result.transform is not None
    aligned = scan_display.full if has_pose else None
    return PageViews(
        placed=_deviation_pictures(result, design, scan_display, deviations),
        parts=_both_segmented(design, design_display, scan, scan_display, is_aligned=has_pose),
        sizes=_sizes(result, design.mesh, aligned, scan.mesh),
    )


def colour_scale(summary: Deviation | None, quality: ScanQuality | None, diagonal_mm: float) -> ColourScale:
    """The scale of the deviations, without their outer 1 % on each side; grey within the tolerance, where
    there is one. diagonal_mm : of the design
    """
    accuracy_mm, noise_mm = (None, None) if quality is None else (quality.accuracy_mm, quality.noise_mm)
    least_mm = resolution_mm(accuracy_mm, noise_mm, diagonal_mm)
    if summary is None:
        return ColourScale.of(0.0, least_mm, None)
    needed_mm = max(abs(summary.p01_mm), abs(summary.p99_mm))
    return ColourScale.of(needed_mm, least_mm, summary.tolerance_mm)


def segment_pictures(
    name: str, analysis: Analysis, display: DisplayMesh, like: Mesh, count: int
) -> list[tuple[str, bytes]]:
    """(caption, PNG) of the segments and landmarks. display : its mesh, in the frame of `like`"""
    landmarks_mm: FloatArray = np.asarray(display.full.vertices[analysis.landmark_vertices])
    colours = display.values(palette.of_clean_vertices(analysis.segmentation, analysis.resampled))
    views = render_views(display.mesh, colours, like, count=count, landmarks_mm=landmarks_mm)
    return [(f"{name} {caption}", data) for caption, data in views]


def _deviation_pictures(
    result: RegistrationResult, design: Analysis, display: DisplayMesh, deviations: Deviations
) -> Pictures | None:
    """The scan under its pose, or under the best rejected pose; None where it has no distances."""
    title, note = "Deviation of the scan from the design", ""
    is_rejected = result.transform is None
    if is_rejected:
        if not result.alternatives:
            return None
        display = display.moved(np.array(result.alternatives[0].matrix))
        title = "Not a measurement: the best pose that was tried, and rejected"
        note = (
            "Where the scan lies on the design here, and where it does not, may tell why the two do not fit."
        )
    if deviations.summary is None:
        return None
    scale = colour_scale(deviations.summary, result.scan, design.mesh.diagonal_mm)
    colours = display.values(scale.colours(deviations.signed_mm, deviations.counted))
    legend = deviation_legend(scale, deviations.summary.sign, rejected=is_rejected)
    images = render_views(display.mesh, colours, design.mesh)
    return Pictures(title, "distances of the scan", images, note, legend)


def _both_segmented(
    design: Analysis,
    design_display: DisplayMesh,
    scan: Analysis,
    scan_display: DisplayMesh,
    *,
    is_aligned: bool,
) -> Pictures:
    """Segments of both beside each other; with a pose from the same sides, in whatever frame the scan was
    uploaded.
    """
    of_design = segment_pictures("design", design, design_display, design.mesh, count=2)
    like = design.mesh if is_aligned else scan_display.full
    of_scan = segment_pictures("scan", scan, scan_display, like, count=2)
    beside = [each for pair in zip(of_design, of_scan, strict=True) for each in pair]
    note = f"{SEGMENTS_NOTE} Each mesh is numbered and coloured by itself."
    return Pictures("Segments and landmarks", "segments of the", beside, note)


def _sizes(result: RegistrationResult, design: Mesh, aligned: Mesh | None, scan: Mesh) -> str:
    """Extents along the axes of the design's file; without a pose those of the scan along its own file's."""
    factor = None if result.scale is None else result.scale.unit_factor
    times = "" if factor is None else f", its numbers times {factor:.4g},"
    where = "along the same axes" if aligned is not None else "along the axes of its file"
    size = _extents(scan if aligned is None else aligned)
    return f"Design {_extents(design)} along the axes of its file; scan{times} {size} {where}."


def _extents(mesh: Mesh) -> str:
    return " x ".join(f"{x:.1f}" for x in np.ptp(mesh.vertices, axis=0)) + " mm"
