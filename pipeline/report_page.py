"""`report.html`: one file that says what a job found to whoever stands at the machine. No script, nothing from elsewhere, and
the same bytes for the same input: it has no date and no timings.
"""

from base64 import b64encode
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from pipeline import palette
from pipeline.colour_scale import ColourScale
from pipeline.mesh import FloatArray, Mesh
from pipeline.outcome import (
    DesignDeviation,
    DesignSide,
    Deviation,
    Distances,
    Input,
    LandmarksResult,
    Metrics,
    Note,
    RegistrationResult,
    Segments,
    StudyResult,
    Verdict,
)
from pipeline.render import four_views, picture

PICTURE_PX = (520, 380)
LEGEND_STEPS = 60
MEANING = {
    "ok": "The pose is found and no other explains the scan as well. The figures below are of this pose.",
    "ambiguous": "More than one pose explains the scan as well: which one is right cannot be told. Do not use the pose unchecked.",
    "under_constrained": "The part can slide or turn along itself without the fit getting worse: the pose is one of a continuum.",
    "units_suspect": "The scan fits only when its numbers are taken in another unit. Send it again with the right unit.",
    "mirrored": "The scan is the mirror image of the design. There is no pose to stand by.",
    "no_match": "The scan does not fit the design anywhere: another part, too little of it, or a print or scan that failed.",
}
MOODS = {"ok": "good", "ambiguous": "warn", "under_constrained": "warn", "units_suspect": "warn"}


@dataclass(frozen=True, slots=True)
class Pictures:
    """A row of pictures; images : (caption, PNG)"""

    title: str
    alt: str
    images: Sequence[tuple[str, bytes]]
    note: str = ""

    def words(self) -> dict[str, object]:
        images = [(name, b64encode(data).decode()) for name, data in self.images]
        return {"title": self.title, "alt": self.alt, "images": images, "note": self.note}


@dataclass(frozen=True, slots=True)
class Table:
    """columns named in `numbers` stand to the right; colours : of a swatch before each row"""

    title: str
    columns: Sequence[str]
    rows: Sequence[Sequence[object]]
    numbers: frozenset[str] = frozenset()
    note: str = ""
    colours: Sequence[str] = field(default_factory=list)


def views_of(
    mesh: Mesh, colours: FloatArray, like: Mesh, *, count: int = 4, marks_mm: FloatArray | None = None
) -> list[tuple[str, bytes]]:
    """Pictures from the sides of `like`, which is in the same frame, all of both in the frame. marks_mm : dots"""
    return [
        (view.name, picture(mesh, colours, view, like.vertices, *PICTURE_PX, marks_mm=marks_mm))
        for view in four_views(like)[:count]
    ]


def registration(
    result: RegistrationResult,
    *,
    deviation: Pictures | None,
    parts: Sequence[Pictures],
    scale: ColourScale | None,
    out: Path,
) -> str:
    """The page of a registration; the drawings are read from `out`."""
    found, metrics = result.deviation, result.metrics
    tiles: list[tuple[str, str]] = []
    if found is not None:
        tiles = [
            ("RMS deviation", f"{found.rms_mm:.3f} mm"),
            ("mean (SD)", f"{found.mean_mm:+.3f} ({found.sd_mm:.3f}) mm"),
            ("from 1 % to 99 %", f"{found.p01_mm:+.3f} to {found.p99_mm:+.3f} mm"),
            ("of the design seen", f"{metrics.design_coverage:.0%}" if metrics.design_coverage is not None else "-"),
        ]
        if found.within is not None and found.tolerance_mm is not None:
            share = f"{found.within:.1%}"
            tiles.insert(0, (f"of the area within ±{found.tolerance_mm:g} mm", share))
    tables = [] if found is None else [_both_ways(found, result.deviation_of_design, metrics)]
    if found is not None and found.by_segment:
        tables.append(
            Table(
                "Deviation by segment of the design",
                ("segment", "vertices", "mean, mm", "SD, mm", "RMS, mm", "least, mm", "most, mm"),
                [
                    (
                        *(each.segment, each.n, f"{each.mean_mm:+.3f}", f"{each.sd_mm:.3f}", f"{each.rms_mm:.3f}"),
                        *(f"{each.min_mm:+.3f}", f"{each.max_mm:+.3f}"),
                    )
                    for each in found.by_segment
                ],
                frozenset({"vertices", "mean, mm", "SD, mm", "RMS, mm", "least, mm", "most, mm"}),
                "Of the scan's vertices by the segment of the closest design point; area-weighted.",
                [_hex(palette.of_segment(each.segment)) for each in found.by_segment],
            )
        )
    tables += [
        _metrics(result),
        *_alternatives(result),
        *_provenance(
            {"design": result.provenance.inputs.design, "scan": result.provenance.inputs.scan},
            result.provenance.version,
            result.provenance.seed,
        ),
    ]
    posed = result.transform is not None
    names = [("Histogram", "deviation_histogram.svg")] if found is not None else []
    names += [("Decision graph of the design", "design.decision_graph.svg")]
    names += [("Decision graph of the scan", "scan.decision_graph.svg")]
    counted = f"{len(result.landmarks.design)} landmarks on the design, {len(result.landmarks.scan)} on the scan"
    return _render(
        title="Registration of a scan to its design",
        subtitle=f"{counted}, {len(result.landmarks.matches)} matched" if posed else counted,
        verdict=_verdict(result.verdict),
        tiles=tiles,
        legend=None if scale is None or found is None else _legend(scale, found.sign),
        pictures=[each.words() for each in (*([deviation] if deviation else []), *parts)],
        drawings=_drawings(out, names),
        tables=tables,
        warnings=_notes(result.warnings),
    )


def landmarks(result: LandmarksResult, parts: Sequence[Pictures], out: Path) -> str:
    """The page of a landmarks job."""
    segments, marked = result.segments.mesh, result.landmarks.mesh
    rows = [
        (each.id, each.segment, f"{each.t2:.2f}", f"{each.strength:.2f}", _point(each.position_mm), each.vertex)
        for each in marked
    ]
    return _render(
        title="Segments and landmarks",
        subtitle=f"{segments.count} segments, {len(marked)} landmarks",
        pictures=[each.words() for each in parts],
        drawings=_drawings(out, [("Decision graph", "mesh.decision_graph.svg")]),
        tables=[
            _segments(segments),
            Table(
                "Landmarks",
                ("id", "segment", "T²", "strength", "position, mm", "vertex"),
                rows,
                frozenset({"T²", "strength", "position, mm", "vertex"}),
                "Strength: T² over its limit. The vertex is one of mesh.clean.ply.",
                [_hex(palette.of_segment(each.segment)) for each in marked],
            ),
            *_provenance({"mesh": result.provenance.inputs.mesh}, result.provenance.version, result.provenance.seed),
        ],
        warnings=_notes(result.warnings),
    )


def study(result: StudyResult, out: Path) -> str:
    """The page of a study."""
    return _render(
        title=f"Study: {result.protocol.kind}",
        subtitle="What landmarks are worth for registration",
        paragraph=result.summary,
        drawings=_drawings(out, [("Result", "study.svg")]),
        tables=_provenance({"mesh": result.provenance.inputs.mesh}, result.provenance.version, result.provenance.seed),
        warnings=_notes(result.warnings),
    )


def _verdict(verdict: Verdict) -> dict[str, object]:
    return {
        "status": verdict.status.replace("_", " "),
        "mood": MOODS.get(verdict.status, "bad"),
        "confidence": f"{verdict.confidence:.2f}" if verdict.confidence else "",
        "sentence": MEANING[verdict.status],
        "findings": [(each.code, each.detail) for each in verdict.findings],
    }


def _both_ways(scan: Deviation, design: DesignDeviation | None, metrics: Metrics) -> Table:
    """Statistics of the scan's vertices beside those of the design's."""
    overlap = None if metrics.scan_overlap is None else f"{metrics.scan_overlap:.1%} within the inlier distance"
    rows: list[tuple[str, ...]] = [
        ("area", overlap or "-", "-" if design is None else f"{design.seen:.1%} shown by the scan"),
        *(
            (name, told(scan), "-" if design is None else told(design))
            for name, told in (
                ("vertices counted", lambda each: str(each.n)),
                ("mean (SD)", lambda each: f"{each.mean_mm:+.3f} ({each.sd_mm:.3f}) mm"),
                ("RMS", lambda each: f"{each.rms_mm:.3f} mm"),
                ("1 % to 99 %", lambda each: f"{each.p01_mm:+.3f} to {each.p99_mm:+.3f} mm"),
                ("least, most", lambda each: f"{each.min_mm:+.3f}, {each.max_mm:+.3f} mm"),
                ("within, above, below the tolerance", _by_tolerance),
            )
        ),
    ]
    return Table(
        "Both directions",
        ("", "scan to design", "design to scan"),
        rows,
        frozenset({"scan to design", "design to scan"}),
        "Design to scan shows what no point of the scan lies near: a piece that broke off, a hole that was filled.",
    )


def _by_tolerance(found: Distances) -> str:
    if found.within is None or found.above is None or found.below is None:
        return "-"
    return f"{found.within:.1%}, {found.above:.1%}, {found.below:.1%}"


SIGNS: dict[DesignSide, str] = {
    "closed": "",
    "open": " The design is open: + is the side that its faces look to.",
    "none": " The faces of the design look to no common side: distances have no sign here.",
}


def _legend(scale: ColourScale, sign: DesignSide) -> dict[str, object]:
    import numpy as np

    middles = (np.arange(LEGEND_STEPS) + 0.5) / LEGEND_STEPS * 2 - 1
    marks = {-1.0, -0.5, 0.0, 0.5, 1.0}
    if scale.tolerance_mm is not None:
        marks = {-1.0, 0.0, 1.0, scale.tolerance_mm / scale.limit_mm, -scale.tolerance_mm / scale.limit_mm}
    words = "Blue: material is missing. Red: there is too much. Dark grey: on an open border, not counted."
    if scale.tolerance_mm is not None:
        words += f" Light grey: within the tolerance of ±{scale.tolerance_mm:g} mm."
    return {
        "colours": [_hex(each) for each in scale.colours(middles * scale.limit_mm)],
        "ticks": [((mark + 1) / 2, f"{mark * scale.limit_mm:+.3g} mm" if mark else "0") for mark in sorted(marks)],
        "words": words + SIGNS[sign],
    }


def _metrics(result: RegistrationResult) -> Table:
    metrics = result.metrics
    rows = [
        ("RMSE as uploaded", _mm(metrics.rmse_initial_mm)),
        ("RMSE by landmarks alone", _mm(metrics.rmse_landmarks_mm)),
        ("RMSE by ICP of the whole shape, without landmarks", _mm(metrics.rmse_complete_mm)),
        ("K, the ratio of the two", "-" if metrics.k_ratio is None else f"{metrics.k_ratio:.3g}"),
        ("RMSE of the final pose", _mm(metrics.rmse_mm)),
        ("scan within the inlier distance", "-" if metrics.fitness is None else f"{metrics.fitness:.1%}"),
        ("inlier distance", _mm(metrics.inlier_distance_mm)),
    ]
    if result.scale is not None:
        rows.append(("size of the scan over the design (not applied)", f"{result.scale.isotropic:.5f}"))
        rows.append(("warp that stays", _mm(result.scale.warp_mm)))
    note = "RMSE: area-weighted, every vertex of the cleaned scan, nothing left out."
    return Table("Registration", ("what", "value"), rows, frozenset({"value"}), note)


def _alternatives(result: RegistrationResult) -> list[Table]:
    if not result.alternatives:
        return []
    rows = [
        (
            number + 1,
            f"{each.score:.3g}",
            _mm(each.rmse_mm),
            "symmetry of the design" if each.symmetry_of_design else "rival",
        )
        for number, each in enumerate(result.alternatives)
    ]
    return [Table("Other poses", ("number", "score", "RMSE", "what it is"), rows, frozenset({"score", "RMSE"}))]


def _segments(segments: Segments) -> Table:
    rows = [
        (each.segment, f"{each.rho:.4g}", f"{each.delta:.3f}", each.size, _point(each.position_mm))
        for each in segments.centres
    ]
    return Table(
        "Segments",
        ("segment", "rho of its centre", "delta, mm", "vertices", "centre, mm"),
        rows,
        frozenset({"rho of its centre", "delta, mm", "vertices", "centre, mm"}),
        f"Metric {segments.metric}, density {segments.density}, d_c {segments.d_c:.3f} mm, halo {segments.halo_fraction:.0%}.",
        [_hex(palette.of_segment(each.segment)) for each in segments.centres],
    )


def _provenance(inputs: dict[str, Input], version: str, seed: int) -> list[Table]:
    rows: list[Sequence[object]] = [(name, given.format, given.unit, given.sha256) for name, given in inputs.items()]
    note = f"Cusp {version}, seed {seed}. All settings and libraries are in results.json."
    return [Table("Provenance", ("mesh", "format", "unit", "SHA-256"), rows, frozenset(), note)]


def _drawings(out: Path, names: Sequence[tuple[str, str]]) -> list[tuple[str, str]]:
    return [(title, b64encode((out / name).read_bytes()).decode()) for title, name in names if (out / name).exists()]


def _notes(notes: Sequence[Note]) -> list[tuple[str, str]]:
    return [(each.code, each.detail) for each in notes]


def _hex(colour: FloatArray) -> str:
    return "#" + "".join(f"{round(255 * float(part)):02x}" for part in colour)


def _mm(value: float | None) -> str:
    return "-" if value is None else f"{value:.3f} mm"


def _point(position_mm: Sequence[float]) -> str:
    return ", ".join(f"{x:.2f}" for x in position_mm)


def _render(**words: object) -> str:
    from jinja2 import Environment, PackageLoader, StrictUndefined

    environment = Environment(
        loader=PackageLoader("pipeline"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    empty: dict[str, object] = {
        "verdict": None,
        "paragraph": "",
        "tiles": [],
        "legend": None,
        "pictures": [],
        "drawings": [],
        "tables": [],
        "warnings": [],
    }
    return environment.get_template("report.html").render(**(empty | words), zip=zip) + "\n"
