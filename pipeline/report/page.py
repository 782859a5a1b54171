"""`report.html`: the result of a job as one self-contained page, without scripts or external resources.

The same input gives the same bytes: the page contains no date and no timings. It prints on A4 with page
numbers. Order: verdict on the pose, warnings, key figures, colour map of the deviation; then the supporting
data.
"""

import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

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
from pipeline.report.inspection_tables import (
    check_tables,
    decision_box,
    extreme_tables,
    reference_table,
)
from pipeline.report.numbers import fixed, millimetres, percent, signed
from pipeline.report.render import MARGIN, View, four_views, picture
from pipeline.report.sections import Drawing, Pictures, Section

if TYPE_CHECKING:
    from jinja2 import Template

#: Width and height of a rendered view.
PICTURE_PX = (520, 380)
MEANING = {
    "ok": "The alignment is valid and unique. The figures below describe the part.",
    "uncertain": "A pose was found and it is the best by a clear lead, but the evidence is not enough to "
    "vouch for it. The findings say what would settle it.",
    "ambiguous": "Several poses fit the scan equally well, and the data do not show which is correct. "
    "Check the pose before you use it.",
    "under_constrained": "The part can move along at least one degree of freedom without a worse fit: "
    "the pose is one of a continuum. Check it before you use it.",
    "units_suspect": "The scan fits the design only in another unit of length. "
    "Submit it again with the correct unit.",
    "mirrored": "The scan is the mirror image of the design. "
    "No valid alignment was found, and no deviation is reported.",
    "no_match": "No valid alignment was found: the scan may show another part, too small a region of "
    "the part, "
    "or a failed print or scan. No pose and no deviation are reported.",
}
#: Digits of an input's SHA-256 in the footer.
HASH_DIGITS = 12
#: Style of the verdict box by status; "bad" for the others.
MOODS = {
    "ok": "good",
    "uncertain": "warn",
    "ambiguous": "warn",
    "under_constrained": "warn",
    "units_suspect": "warn",
}


@dataclass(frozen=True, slots=True)
class PageViews:
    """The rendered views of a registration.

    placed : the scan under its pose, or under the best rejected pose; None if no distances were measured;
    parts : both meshes with segments and landmarks; sizes : one sentence about the sizes of both
    """

    placed: Pictures | None
    parts: Pictures
    sizes: str


def render_views(
    mesh: Mesh, colours: FloatArray, like: Mesh, *, count: int = 4, landmarks_mm: FloatArray | None = None
) -> list[tuple[str, bytes]]:
    """(caption, PNG) of the first `count` of the four views of `like`, with both meshes inside the picture.

    colours : (n, 3) in [0, 1] of the vertices of `mesh`; like : a mesh in the same frame, which defines the
    view directions; landmarks_mm : (m, 3), drawn as dots. The caption gives the width of the picture in mm.
    """
    frame = like.vertices if mesh is like else np.concatenate([like.vertices, mesh.vertices])

    def rendered(view: View) -> tuple[str, bytes]:
        data = picture(mesh, colours, view, frame, *PICTURE_PX, landmarks_mm=landmarks_mm)
        return f"{view.name}; the picture is {_width_mm(view, frame):.3g} mm wide", data

    # The kernel that draws and the compression both work without the interpreter's lock.
    with ThreadPoolExecutor(len(os.sched_getaffinity(0))) as threads:
        return list(threads.map(rendered, four_views(like)[:count]))


def _width_mm(view: View, frame: FloatArray) -> float:
    """The extent in mm that `picture` fits into the width of the picture."""
    width, height = np.ptp(frame @ view.axes[:2].T, axis=0)
    return float(MARGIN * max(width, height * PICTURE_PX[0] / PICTURE_PX[1]))


def registration(result: RegistrationResult, views: PageViews, out: Path) -> str:
    """The page of a registration; the drawings are read from `out`."""
    deviation, has_pose = result.deviation, result.transform is not None
    sections: list[Section] = [*reference_table(result.reference), *check_tables(result.inspection)]
    sections += [] if views.placed is None else [views.placed]
    sections += extreme_tables(result.inspection)
    if deviation is not None:
        sections += _drawing(out, "Histogram of the deviation", "deviation_histogram.svg")
        sections += [tables.both_ways(deviation, result.deviation_of_design, result.metrics)]
        sections += tables.by_segment(deviation.by_segment)
    sections += tables.pose(result.transform)
    sections += [tables.registration(result)]
    sections += tables.alternatives(result.alternatives, rejected=not has_pose)
    sections += [views.parts]
    sections += _drawing(out, "Decision graph of the design", "design.decision_graph.svg")
    sections += _drawing(out, "Decision graph of the scan", "scan.decision_graph.svg")
    counted = (
        f"{len(result.landmarks.design)} landmarks on the design and {len(result.landmarks.scan)} on the scan"
    )
    return _render(
        *("Registration of a scan to its design", sections, result.warnings),
        inputs={"scan": result.provenance.inputs.scan, "design": result.provenance.inputs.design},
        made_by=result.provenance,
        subtitle=f"{views.sizes} {counted}, {len(result.landmarks.matches)} matched."
        if has_pose
        else f"{views.sizes} {counted}.",
        verdict=result.verdict,
        decision=decision_box(result.inspection),
        tiles=_key_figures(result, deviation),
    )


def landmarks(result: LandmarksResult, pictures: Pictures, out: Path) -> str:
    """The page of a landmarks job."""
    segments, count = result.segments.mesh, len(result.landmarks.mesh)
    drawings = _drawing(out, "Decision graph", "mesh.decision_graph.svg")
    return _render(
        "Segments and landmarks",
        [pictures, *drawings, tables.segments(segments), tables.landmarks(result)],
        result.warnings,
        inputs={"mesh": result.provenance.inputs.mesh},
        made_by=result.provenance,
        subtitle=f"{segments.count} segments, {count} landmarks",
    )


def study(result: StudyResult, out: Path) -> str:
    """The page of a study."""
    return _render(
        *(f"Study: {result.protocol.kind}", _drawing(out, "Result", "study.svg", full=True), result.warnings),
        inputs={"mesh": result.provenance.inputs.mesh},
        made_by=result.provenance,
        subtitle="How useful the landmarks are for registration",
        paragraph=result.summary,
    )


def _key_figures(result: RegistrationResult, deviation: Deviation | None) -> list[tuple[str, str]]:
    """(label, value) of the deviation; the share within the tolerance comes first."""
    if deviation is None:
        return []
    within = []
    if deviation.within is not None and deviation.tolerance_mm is not None:
        label = f"of the area within ±{deviation.tolerance_mm:g} mm"
        within = [(label, percent(deviation.within))]
    return [
        *within,
        ("RMS deviation", millimetres(deviation.rms_mm)),
        ("mean (SD) deviation", f"{signed(deviation.mean_mm)} ({fixed(deviation.sd_mm)}) mm"),
        ("98 % of the area", f"{signed(deviation.p01_mm)} to {signed(deviation.p99_mm)} mm"),
        ("of the design covered", percent(result.metrics.design_coverage, 0)),
    ]


def _verdict(verdict: Verdict) -> dict[str, object]:
    return {
        "status": verdict.status.replace("_", " "),
        "mood": MOODS.get(verdict.status, "bad"),
        "confidence": _confidence(verdict.confidence),
        "why": tables.evidence(verdict),
        "sentence": MEANING[verdict.status],
        "findings": [(each.code, each.detail) for each in verdict.findings],
    }


def _confidence(value: float | None) -> str:
    """Nothing without a pose, which has confidence 0."""
    if value is None:
        return f"confidence {tables.NOT_GIVEN}"
    return f"confidence {value:.2f} (0 to 1)" if value > 0 else ""


def _drawing(out: Path, title: str, name: str, *, full: bool = False) -> list[Drawing]:
    """The SVG file `name` of the folder `out`; nothing if the job did not write it."""
    return [Drawing(title, (out / name).read_bytes(), full)] if (out / name).exists() else []


@cache
def template() -> "Template":
    """The template of every page; compiled by the first call, which `pipeline.preload` makes."""
    from jinja2 import Environment, PackageLoader, StrictUndefined

    environment = Environment(
        loader=PackageLoader("pipeline.report"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    return environment.get_template("report.html")


def _render(
    title: str,
    sections: Sequence[Section],
    warnings: Sequence[Note],
    *,
    inputs: dict[str, Input],
    made_by: MadeBy,
    subtitle: str,
    verdict: Verdict | None = None,
    decision: dict[str, object] | None = None,
    paragraph: str = "",
    tiles: Sequence[tuple[str, str]] = (),
) -> str:
    """The HTML. inputs : by name; the footer of each printed page gives the first digits of their hashes"""
    files = ", ".join(f"{name} {file.sha256[:HASH_DIGITS]}" for name, file in inputs.items())
    page = template().render(
        title=title,
        subtitle=subtitle,
        verdict=None if verdict is None else _verdict(verdict),
        decision=decision,
        paragraph=paragraph,
        tiles=tiles,
        warnings=warnings,
        sections=[*sections, tables.provenance(inputs, made_by)],
        foot=f"{files}; Cusp {made_by.version}",
        zip=zip,
    )
    return page + "\n"
