"""`report.html`: the result of a job as one self-contained page, without scripts or external resources.

The same input gives the same bytes: date and job are those that the caller states. It prints on A4 with
page numbers. Order: which part, decision and verdict, key figures, checks, colour map of the deviation; then
how it was found.
"""

from base64 import b64encode
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

from pipeline.core.report_header import ReportHeader
from pipeline.core.results import (
    Finding,
    Input,
    LandmarksResult,
    MadeBy,
    Note,
    RegistrationResult,
    Scale,
    ScaleFactor,
    StudyResult,
    Verdict,
)
from pipeline.report import tables
from pipeline.report.inspection_tables import check_tables, decision_box, extreme_tables, identity
from pipeline.report.registration_pictures import PageViews
from pipeline.report.sections import Drawings, Heading, Pictures, Section
from pipeline.report.words import ENGLISH, Words

if TYPE_CHECKING:
    from jinja2 import Template

NO_HEADER = ReportHeader()
MEANING = {
    "ok": "The scan is aligned. This pose fits clearly better than any other.",
    "uncertain": (
        "The scan is aligned, and this pose fits clearly better than any other, but it is not certain "
        "that the scan shows this part, undamaged and in this pose. The findings say why. Check the "
        "pose before you use it."
    ),
    "ambiguous": (
        "The scan does not show which pose is right: another one, or the mirror image, fits nearly as "
        "well, or the scan is flat. The findings say which. Check the pose before you use it."
    ),
    "under_constrained": (
        "The scan can slide or turn on the design with hardly any change of the fit, so this motion of "
        "the pose is uncertain. The findings say which motion, and by how much."
    ),
    "units_suspect": "The scan fits only in another unit of length. Send it again with the unit that "
    "the findings name (options.units).",
    "mirrored": (
        "The scan is the mirror image of the design. No valid alignment was found, and no deviation is "
        "reported."
    ),
    "no_match": (
        "No valid alignment was found, and no deviation is reported. The scan shows another part, too "
        "little of this one, or a failed print."
    ),
}
#: Instead of `ok`, of a design that is its own image.
MEANING_SYMMETRIC = (
    "The scan is aligned. The design is symmetric: its equivalent poses fit as well, and each is "
    "correct. Every other pose fits clearly worse."
)
#: Statuses without a pose, and findings that are about the best pose that was tried, not about the reason.
WITHOUT_POSE = frozenset({"mirrored", "no_match"})
ABOUT_POSE = frozenset(
    {"free_motion", "symmetric_design", "rival_pose", "weakly_constrained", "few_landmarks", "not_converged"}
)
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


def registration(
    result: RegistrationResult,
    views: PageViews,
    out: Path,
    header: ReportHeader = NO_HEADER,
    words: Words = ENGLISH,
    *,
    summary: bool = False,
) -> str:
    """The page of a registration; the drawings are read from `out`. summary : the first page only"""
    sections: list[Section] = [*check_tables(result.inspection, words)]
    sections += [] if views.placed is None else [views.placed]
    if result.deviation is not None:
        sections += _drawings(out, words("Histogram of the deviation"), ("deviation_histogram.svg",))
    sections += [] if summary else _details(result, views, out, words)
    return _render(
        *(words("Inspection report"), sections, result.warnings),
        inputs={"scan": result.provenance.inputs.scan, "design": result.provenance.inputs.design},
        made_by=result.provenance,
        subtitle=words("Scan of a printed part, registered to its design"),
        verdict=result.verdict,
        decision=decision_box(result.inspection, words),
        tiles=_key_figures(result, words),
        facts=identity(result.reference, header, words),
        header=header,
        words=words,
        summary=summary,
    )


def _details(result: RegistrationResult, views: PageViews, out: Path, words: Words) -> list[Section]:
    """What follows the first page: sections and tables, then how it was found."""
    deviation, has_pose = result.deviation, result.transform is not None
    sections: list[Section] = []
    sections += [] if views.sections is None else [views.sections]
    sections += extreme_tables(result.inspection, words)
    if deviation is not None:
        is_cloud = any(note.code == "point_cloud" for note in result.warnings)
        sections += [tables.both_ways(deviation, result.deviation_of_design, words, is_cloud=is_cloud)]
        sections += tables.by_segment(deviation.by_segment, words)
    matched = f", {words('{count} matched', count=len(result.landmarks.matches))}" if has_pose else ""
    note = words(
        "{design} landmarks on the design, {scan} on the scan",
        design=len(result.landmarks.design),
        scan=len(result.landmarks.scan),
    )
    sections += [Heading(words("How it was found"), f"{views.sizes} {note}{matched}.")]
    sections += tables.pose(result.transform, words)
    sections += [tables.registration(result, words)]
    sections += tables.alternatives(result.alternatives, rejected=not has_pose, words=words)
    sections += [views.parts]
    graphs = ("design.decision_graph.svg", "scan.decision_graph.svg")
    sections += _drawings(out, words("Decision graphs"), graphs)
    return sections


def landmarks(
    result: LandmarksResult,
    pictures: Pictures,
    out: Path,
    header: ReportHeader = NO_HEADER,
    words: Words = ENGLISH,
) -> str:
    """The page of a landmarks job."""
    segments, count = result.segments.mesh, len(result.landmarks.mesh)
    drawings = _drawings(out, words("Decision graph"), ("mesh.decision_graph.svg",))
    return _render(
        words("Segments and landmarks"),
        [pictures, *drawings, tables.segments(segments, words), tables.landmarks(result, words)],
        result.warnings,
        inputs={"mesh": result.provenance.inputs.mesh},
        made_by=result.provenance,
        subtitle=words(
            "{segments} segments, {landmarks} landmarks", segments=segments.count, landmarks=count
        ),
        facts=identity(None, header, words),
        header=header,
        words=words,
    )


def study(
    result: StudyResult, summary: str, out: Path, header: ReportHeader = NO_HEADER, words: Words = ENGLISH
) -> str:
    """The page of a study. summary : in the language of the page"""
    return _render(
        words("Study: {kind}", kind=words(result.protocol.kind)),
        _drawings(out, words("Result"), ("study.svg",), full=True),
        result.warnings,
        inputs={"mesh": result.provenance.inputs.mesh},
        made_by=result.provenance,
        subtitle=words("How useful the landmarks are for registration"),
        paragraph=summary,
        facts=identity(None, header, words),
        header=header,
        words=words,
    )


def _key_figures(result: RegistrationResult, words: Words) -> list[tuple[str, str, str]]:
    """(label, value, more) of the deviation, as on the first screen of the page."""
    deviation = result.deviation
    if deviation is None:
        return []
    within = words("no tolerance") if deviation.within is None else words.percent(deviation.within)
    label = words("within tolerance")
    if deviation.tolerance_mm is not None:
        label = words("within ±{size} mm", size=words.local(f"{deviation.tolerance_mm:g}"))
    seen = result.deviation_of_design
    coverage = result.metrics.design_coverage if seen is None else seen.seen
    return [
        ("min", f"{words.signed(deviation.min_mm)} mm", ""),
        ("max", f"{words.signed(deviation.max_mm)} mm", ""),
        (label, within, ""),
        ("RMS", words.millimetres(deviation.rms_mm), ""),
        (words("mean"), f"{words.signed(deviation.mean_mm)} mm", ""),
        ("SD", words.millimetres(deviation.sd_mm), ""),
        (words("coverage of the design"), words.percent(coverage), ""),
        *_sizes(result.scale, words),
    ]


def _sizes(scale: Scale | None, words: Words) -> list[tuple[str, str, str]]:
    """The size of the scan over that of the design, and what a slicer asks for to make up for it."""
    if scale is None or all(each.scale is None for each in scale.factors):
        return []

    def change(each: ScaleFactor) -> str:
        if each.scale is None or each.standard_error is None:
            return words("not determined")
        return f"{words.signed(100 * (each.scale - 1), 2)} ± {words.fixed(196 * each.standard_error, 2)} %"

    def factor(each: ScaleFactor) -> str:
        return "-" if each.slicer_percent is None else f"{words.fixed(each.slicer_percent, 2)} %"

    whole, *axes = scale.factors
    return [
        (label, of(whole), ", ".join(f"{each.axis} {of(each)}" for each in axes))
        for label, of in (
            (words("size of the scan"), change),
            (words("scale to set in the slicer (not applied)"), factor),
        )
    ]


def _verdict(verdict: Verdict, words: Words) -> dict[str, object]:
    folded = ABOUT_POSE if verdict.status in WITHOUT_POSE else frozenset()
    is_symmetric = any(each.code == "symmetric_design" for each in verdict.findings)
    meaning = MEANING_SYMMETRIC if verdict.status == "ok" and is_symmetric else MEANING[verdict.status]
    return {
        "status": words(verdict.status.replace("_", " ")),
        "mood": MOODS.get(verdict.status, "bad"),
        "confidence": _confidence(verdict.confidence, words),
        "why": tables.evidence(verdict, words),
        "sentence": words(meaning),
        # Without a pose the reason comes first; what is said of the rejected pose is not the reason.
        "findings": _findings(
            [each for each in verdict.findings if not folded or each.code not in ABOUT_POSE], words
        ),
        "about": _findings([each for each in verdict.findings if folded and each.code in ABOUT_POSE], words),
    }


def _findings(findings: Sequence[Finding], words: Words) -> list[tuple[str, str]]:
    return [(each.code, words.sentence(each.detail)) for each in findings]


def _confidence(value: float | None, words: Words) -> str:
    """Nothing without a pose, which has confidence 0."""
    if value is None:
        return f"{words('confidence')} {words(tables.NOT_GIVEN)}"
    return f"{words('confidence')} {words.fixed(value, 2)} ({words('0 to 1')})" if value > 0 else ""


def _drawings(out: Path, title: str, names: Sequence[str], *, full: bool = False) -> list[Drawings]:
    """The SVG files of the folder `out`; nothing if the job did not write them."""
    found = [("", (out / name).read_bytes()) for name in names if (out / name).exists()]
    return [Drawings(title, found, full=full)] if found else []


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
    tiles: Sequence[tuple[str, str, str]] = (),
    facts: Sequence[tuple[str, str]] = (),
    header: ReportHeader = NO_HEADER,
    words: Words = ENGLISH,
    summary: bool = False,
) -> str:
    """The HTML. inputs : by name; the footer of each printed page gives the first digits of their hashes"""
    files = ", ".join(f"{words(name)} {file.sha256[:HASH_DIGITS]}" for name, file in inputs.items())
    logo = ""
    if header.logo is not None:
        logo = f"data:{header.logo_type};base64,{b64encode(header.logo).decode()}"
    page = template().render(
        title=title,
        subtitle=subtitle,
        verdict=None if verdict is None else _verdict(verdict, words),
        decision=decision,
        paragraph=paragraph,
        tiles=tiles,
        facts=facts,
        company=header.company,
        logo=logo,
        warnings=[(note.code, words.note(note.code, note.detail)) for note in warnings],
        sections=sections if summary else [*sections, tables.provenance(inputs, made_by, words)],
        summary=summary,
        foot=f"{files}; Cusp {made_by.version}",
        words=words,
        zip=zip,
    )
    return page + "\n"
