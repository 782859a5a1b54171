"""`report.html`: one file that says what a job found to whoever stands at the machine. No script, nothing from elsewhere, and
the same bytes for the same input: it has no date and no timings. Printed, it is A4 with numbered pages.

In order: may the pose be trusted, what needs a look, the figures, the deviation in colours; then what they rest on.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pipeline.core.mesh import FloatArray, Mesh
from pipeline.core.results import (
    Deviation,
    Input,
    LandmarksResult,
    MadeBy,
    Note,
    RegistrationResult,
    StudyResult,
    Verdict,
)
from pipeline.report import tables
from pipeline.report.render import MARGIN, View, four_views, picture
from pipeline.report.sections import Drawing, Pictures, Section

PICTURE_PX = (520, 380)
MEANING = {
    "ok": "The pose is found and no other explains the scan as well. Whether the print is good, the figures below say.",
    "ambiguous": "More than one pose explains the scan as well: which one is right cannot be told. Do not use the pose unchecked.",
    "under_constrained": "The part can slide or turn along itself without the fit getting worse: the pose is one of a continuum. "
    "Do not use it unchecked.",
    "units_suspect": "The scan fits only when its numbers are taken in another unit. Send it again with the right unit.",
    "mirrored": "The scan is the mirror image of the design. There is no pose to stand by, and no deviation is reported.",
    "no_match": "The scan does not fit the design anywhere: another part, too little of it, or a print or scan that failed. "
    "No pose and no deviation are reported.",
}
MOODS = {"ok": "good", "ambiguous": "warn", "under_constrained": "warn", "units_suspect": "warn"}


@dataclass(frozen=True, slots=True)
class PageViews:
    """What a registration's page shows of its meshes. placed : the scan under its pose, or under the best that was rejected;
    None where it has no distances; parts : both with segments and landmarks; sizes : of both, in words
    """

    placed: Pictures | None
    parts: Pictures
    sizes: str


def render_views(
    mesh: Mesh, colours: FloatArray, like: Mesh, *, count: int = 4, landmarks_mm: FloatArray | None = None
) -> list[tuple[str, bytes]]:
    """Pictures from the sides of `like`, which is in the same frame, all of both in the frame; captions say how wide
    they are in mm. landmarks_mm : dots
    """
    frame = like.vertices if mesh is like else np.concatenate([like.vertices, mesh.vertices])
    return [
        (
            f"{view.name}; the picture is {_width_mm(view, frame):.3g} mm wide",
            picture(mesh, colours, view, frame, *PICTURE_PX, landmarks_mm=landmarks_mm),
        )
        for view in four_views(like)[:count]
    ]


def _width_mm(view: View, frame: FloatArray) -> float:
    """What `picture` fits into its width."""
    width, height = np.ptp(frame @ view.axes[:2].T, axis=0)
    return float(MARGIN * max(width, height * PICTURE_PX[0] / PICTURE_PX[1]))


def registration(result: RegistrationResult, views: PageViews, out: Path) -> str:
    """The page of a registration; the drawings are read from `out`."""
    found, posed = result.deviation, result.transform is not None
    sections: list[Section] = [] if views.placed is None else [views.placed]
    if found is not None:
        sections += _drawing(out, "Histogram of the deviation", "deviation_histogram.svg")
        sections += [tables.both_ways(found, result.deviation_of_design, result.metrics)]
        sections += tables.by_segment(found.by_segment)
    sections += tables.pose(result.transform)
    sections += [tables.registration(result)]
    sections += tables.alternatives(result.alternatives, rejected=not posed)
    sections += [views.parts]
    sections += _drawing(out, "Decision graph of the design", "design.decision_graph.svg")
    sections += _drawing(out, "Decision graph of the scan", "scan.decision_graph.svg")
    counted = (
        f"{len(result.landmarks.design)} landmarks on the design, {len(result.landmarks.scan)} on the scan"
    )
    return _render(
        *("Registration of a scan to its design", sections, result.warnings),
        inputs={"scan": result.provenance.inputs.scan, "design": result.provenance.inputs.design},
        made_by=result.provenance,
        subtitle=f"{views.sizes} {counted}, {len(result.landmarks.matches)} matched."
        if posed
        else f"{views.sizes} {counted}.",
        verdict=result.verdict,
        tiles=_figures(result, found),
    )


def landmarks(result: LandmarksResult, shown: Pictures, out: Path) -> str:
    """The page of a landmarks job."""
    segments, marked = result.segments.mesh, result.landmarks.mesh
    drawings = _drawing(out, "Decision graph", "mesh.decision_graph.svg")
    return _render(
        "Segments and landmarks",
        [shown, *drawings, tables.segments(segments), tables.landmarks(result)],
        result.warnings,
        inputs={"mesh": result.provenance.inputs.mesh},
        made_by=result.provenance,
        subtitle=f"{segments.count} segments, {len(marked)} landmarks",
    )


def study(result: StudyResult, out: Path) -> str:
    """The page of a study."""
    return _render(
        *(f"Study: {result.protocol.kind}", _drawing(out, "Result", "study.svg", full=True), result.warnings),
        inputs={"mesh": result.provenance.inputs.mesh},
        made_by=result.provenance,
        subtitle="What landmarks are worth for registration",
        paragraph=result.summary,
    )


def _figures(result: RegistrationResult, found: Deviation | None) -> list[tuple[str, str]]:
    """(what, figure) of the deviation, with the share within the tolerance first: it decides."""
    if found is None:
        return []
    seen = result.metrics.design_coverage
    within = []
    if found.within is not None and found.tolerance_mm is not None:
        within = [(f"of the area within ±{found.tolerance_mm:g} mm", f"{found.within:.1%}")]
    return [
        *within,
        ("RMS deviation", f"{found.rms_mm:.3f} mm"),
        ("mean (SD) deviation", f"{found.mean_mm:+.3f} ({found.sd_mm:.3f}) mm"),
        ("98 % of the area", f"{found.p01_mm:+.3f} to {found.p99_mm:+.3f} mm"),
        ("of the design seen", "-" if seen is None else f"{seen:.0%}"),
    ]


def _verdict(verdict: Verdict) -> dict[str, object]:
    return {
        "status": verdict.status.replace("_", " "),
        "mood": MOODS.get(verdict.status, "bad"),
        "confidence": f"{verdict.confidence:.2f}" if verdict.confidence else "",
        "sentence": MEANING[verdict.status],
        "findings": [(each.code, each.detail) for each in verdict.findings],
    }


def _drawing(out: Path, title: str, name: str, *, full: bool = False) -> list[Drawing]:
    """Nothing where the job left no such file."""
    return [Drawing(title, (out / name).read_bytes(), full)] if (out / name).exists() else []


def _render(
    title: str,
    sections: Sequence[Section],
    warnings: Sequence[Note],
    *,
    inputs: dict[str, Input],
    made_by: MadeBy,
    subtitle: str,
    verdict: Verdict | None = None,
    paragraph: str = "",
    tiles: Sequence[tuple[str, str]] = (),
) -> str:
    """inputs : name -> file, which the foot of each printed page names by the start of its hash"""
    from jinja2 import Environment, PackageLoader, StrictUndefined

    environment = Environment(
        loader=PackageLoader("pipeline.report"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    files = ", ".join(f"{name} {given.sha256[:12]}" for name, given in inputs.items())
    page = environment.get_template("report.html").render(
        title=title,
        subtitle=subtitle,
        verdict=None if verdict is None else _verdict(verdict),
        paragraph=paragraph,
        tiles=tiles,
        warnings=warnings,
        sections=[*sections, tables.provenance(inputs, made_by)],
        foot=f"{files}; Cusp {made_by.version}",
        zip=zip,
    )
    return page + "\n"
