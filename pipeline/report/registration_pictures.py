"""The pictures of a registration's report: the scan on the design, cross-sections, the segments of both."""

from dataclasses import dataclass

import numpy as np

from pipeline.analysis.mesh_analysis import Analysis
from pipeline.core.mesh import FloatArray, Mesh
from pipeline.core.results import Deviation, RegistrationResult, ScanQuality
from pipeline.kernels.nearest import nearest
from pipeline.report import cross_section, palette
from pipeline.report.colormap import ColourScale, resolution_mm
from pipeline.report.cross_section import Place
from pipeline.report.glb import DisplayMesh
from pipeline.report.sections import Drawings, Pictures
from pipeline.report.sections import legend as deviation_legend
from pipeline.report.shots import PICTURE_PX, SMALL_PX, Pin, Shot, is_seen, shoot
from pipeline.report.views import standard_views, views_facing
from pipeline.report.words import Words
from pipeline.stages.deviation import Deviations

SEGMENTS_NOTE = "One colour a segment, halo paler; dots are landmarks."
#: Faces of the scan that are compared with the design to tell its fronts.
SIDES_COMPARED = 200


@dataclass(frozen=True, slots=True)
class PageViews:
    """The pictures of a registration.

    placed : the scan under its pose, or under the best rejected pose; None if no distances were measured;
    sections : through the extremes; None without a pose; parts : both meshes with segments and landmarks;
    sizes : one sentence about the sizes of both
    """

    placed: Pictures | None
    sections: Drawings | None
    parts: Pictures
    sizes: str


def registration_views(
    result: RegistrationResult,
    design: Analysis,
    design_display: DisplayMesh,
    scan: Analysis,
    scan_display: DisplayMesh,
    deviations: Deviations,
    words: Words,
) -> PageViews:
    """scan_display : in the design's frame where there is a pose, else in its own"""
    has_pose = result.transform is not None
    aligned = scan_display.full if has_pose else None
    scale = colour_scale(deviations.summary, result.scan, design.mesh.diagonal_mm)
    places = _extremes(aligned, deviations) if aligned is not None else []
    return PageViews(
        placed=_deviation_pictures(result, design, scan_display, deviations, scale, places, words),
        sections=_sections(places, design.mesh, aligned, deviations, scale, words),
        parts=_both_segmented(design, design_display, scan, scan_display, words, is_aligned=has_pose),
        sizes=_sizes(result, design.mesh, aligned, scan.mesh, words),
    )


def colour_scale(summary: Deviation | None, quality: ScanQuality | None, diagonal_mm: float) -> ColourScale:
    """The scale of the deviations, without their outer 1 % on each side; grey within the tolerance, where
    there is one. diagonal_mm : of the design
    """
    accuracy_mm, noise_mm = (None, None) if quality is None else (quality.accuracy_mm, quality.noise_mm)
    if noise_mm is not None and summary is not None:
        noise_mm = min(noise_mm, summary.sd_mm)  # of few points it is overestimated
    least_mm = resolution_mm(accuracy_mm, noise_mm, diagonal_mm)
    if summary is None:
        return ColourScale.of(0.0, least_mm, None)
    needed_mm = max(abs(summary.p01_mm), abs(summary.p99_mm))
    return ColourScale.of(needed_mm, least_mm, summary.tolerance_mm)


def segment_pictures(
    caption: str,
    analysis: Analysis,
    display: DisplayMesh,
    like: Mesh,
    names: list[str],
    words: Words,
    size_px: tuple[int, int] = PICTURE_PX,
) -> list[Shot]:
    """The named views of the segments and landmarks. display : its mesh, in the frame of `like`"""
    landmarks_mm: FloatArray = np.asarray(display.full.vertices[analysis.landmark_vertices])
    colours = display.values(palette.of_clean_vertices(analysis.segmentation, analysis.resampled))
    return shoot(
        *(display.mesh, colours, like, names),
        caption=lambda name: f"{caption} {words(name)}",
        landmarks_mm=landmarks_mm,
        size_px=size_px,
    )


def _extremes(aligned: Mesh, deviations: Deviations) -> list[Place]:
    """The lowest and the highest vertex that is counted."""
    counted = np.flatnonzero(deviations.counted)
    if not len(counted):
        return []
    signed = deviations.signed_mm[counted]
    found = (counted[signed.argmin()], counted[signed.argmax()])
    return [Place(aligned.vertices[k], float(deviations.signed_mm[k])) for k in found]


def _deviation_pictures(
    result: RegistrationResult,
    design: Analysis,
    display: DisplayMesh,
    deviations: Deviations,
    scale: ColourScale,
    places: list[Place],
    words: Words,
) -> Pictures | None:
    """The scan under its pose, or under the best rejected pose; None where it has no distances."""
    title, note = words("Deviation of the scan from the design"), ""
    is_rejected = result.transform is None
    if is_rejected:
        if not result.alternatives:
            return None
        display = display.moved(np.array(result.alternatives[0].matrix))
        title = words("Not a measurement: the best of the rejected poses")
        note = words("Where the scan lies off the design here may tell why the two do not fit.")
    if deviations.summary is None:
        return None
    colours = display.values(scale.colours(deviations.signed_mm, deviations.counted))
    legend = deviation_legend(scale, deviations.summary.sign, rejected=is_rejected, words=words)
    pins = [
        Pin(f"{name} {words.signed(each.value_mm)} mm", each.position_mm)
        for name, each in zip(("min", "max"), places, strict=False)
    ]
    is_open = deviations.summary.sign == "open" and not display.mesh.is_cloud
    fronts = _fronts(display.mesh, design.mesh) if is_open else 0
    shots = _shots(display.mesh, colours, design.mesh, pins, places, fronts, words)
    return Pictures(title, words("distances of the scan, view"), shots, note, legend)


def _fronts(scan: Mesh, design: Mesh) -> int:
    """1 where the faces of the scan look to the side that those of the design look to, else -1."""
    some = np.arange(0, len(scan.faces), max(1, len(scan.faces) // SIDES_COMPARED))
    middles = scan.vertices[scan.faces[some]].mean(axis=1)
    of_design = design.vertex_normals()[nearest(design.vertices, middles)[1]]
    agreement = float(np.einsum("kd,kd->", scan.face_cross_mm2()[some], of_design))
    return 1 if agreement >= 0 else -1


def _shots(
    mesh: Mesh,
    colours: FloatArray,
    design: Mesh,
    pins: list[Pin],
    places: list[Place],
    fronts: int,
    words: Words,
) -> list[Shot]:
    """Four views; the first shows the largest deviation, if one of those that look at its front does."""
    names, first = standard_views(design), None
    if places:
        worst = max(places, key=lambda each: abs(each.value_mm)).position_mm
        facing = views_facing(cross_section.normal_near(design, worst))
        surface = design if mesh.is_cloud else mesh
        first = next((name for name in facing if is_seen(surface, name, worst)), None)
    if first is not None:
        names = [first, *(each for each in names if each != first)][:4]

    def caption(name: str) -> str:
        said = words(name)
        return words("{view}: shows the largest deviation", view=said) if name == first else said

    return shoot(mesh, colours, design, names, caption=caption, pins=pins, fronts=fronts)


def _sections(
    places: list[Place],
    design: Mesh,
    aligned: Mesh | None,
    deviations: Deviations,
    scale: ColourScale,
    words: Words,
) -> Drawings | None:
    if aligned is None or not places:
        return None
    drawings = [
        cross_section.draw(place, design, aligned, deviations.signed_mm, scale, words) for place in places
    ]
    named = [
        (f"{name} {caption}", svg) for name, (caption, svg) in zip(("min", "max"), drawings, strict=True)
    ]
    return Drawings(words("Cross-sections through min and max"), named)


def _both_segmented(
    design: Analysis,
    design_display: DisplayMesh,
    scan: Analysis,
    scan_display: DisplayMesh,
    words: Words,
    *,
    is_aligned: bool,
) -> Pictures:
    """Segments of both beside each other; with a pose from the same sides, in whatever frame the scan was
    uploaded.
    """
    like = design.mesh if is_aligned else scan_display.full
    of_design = segment_pictures(
        words("design"), design, design_display, design.mesh, standard_views(design.mesh)[:2], words, SMALL_PX
    )
    of_scan = segment_pictures(
        words("scan"), scan, scan_display, like, standard_views(like)[:2], words, SMALL_PX
    )
    beside = [each for pair in zip(of_design, of_scan, strict=True) for each in pair]
    note = f"{words(SEGMENTS_NOTE)} {words('Each mesh is numbered and coloured by itself.')}"
    return Pictures(words("Segments and landmarks"), words("segments,"), beside, note)


def _sizes(result: RegistrationResult, design: Mesh, aligned: Mesh | None, scan: Mesh, words: Words) -> str:
    """Extents along the axes of the design's file; without a pose those of the scan along its own file's."""
    factor = None if result.scale is None else result.scale.unit_factor
    times = "" if factor is None else words(", its numbers times {factor},", factor=words.short(factor, 4))
    where = words("along the same axes") if aligned is not None else words("along the axes of its file")
    return words(
        "Design {design} along the axes of its file; scan{times} {scan} {where}.",
        design=_extents(design, words),
        times=times,
        scan=_extents(scan if aligned is None else aligned, words),
        where=where,
    )


def _extents(mesh: Mesh, words: Words) -> str:
    return " x ".join(words.fixed(x, 1) for x in np.ptp(mesh.vertices, axis=0)) + " mm"
