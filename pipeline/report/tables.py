"""The tables of the report: figures of the result records in words, lengths in mm."""

from collections.abc import Sequence
from dataclasses import dataclass, field

from pipeline.core.mesh import FloatArray
from pipeline.core.results import (
    Alternative,
    DesignDeviation,
    Deviation,
    Distances,
    Input,
    LandmarksResult,
    MadeBy,
    Metrics,
    RegistrationResult,
    SegmentDeviation,
    Segments,
    Transform,
)
from pipeline.report import palette


@dataclass(frozen=True, slots=True)
class Table:
    """columns named in `numbers` stand to the right; colours : of a swatch before each row"""

    title: str
    columns: Sequence[str]
    rows: Sequence[Sequence[object]]
    numbers: frozenset[str] = frozenset()
    note: str = ""
    colours: Sequence[str] = field(default_factory=list)
    kind: str = "table"  # of section, for the template


def both_ways(scan: Deviation, design: DesignDeviation | None, metrics: Metrics) -> Table:
    """Statistics of the scan's vertices beside those of the design's."""
    overlap = (
        None if metrics.scan_overlap is None else f"{metrics.scan_overlap:.1%} within the inlier distance"
    )
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
        return "no tolerance was sent"
    return f"{found.within:.1%}, {found.above:.1%}, {found.below:.1%}"


def by_segment(found: Sequence[SegmentDeviation]) -> list[Table]:
    """One row a segment; nothing where there is none."""
    if not found:
        return []
    columns = ("segment", "vertices", "mean, mm", "SD, mm", "RMS, mm", "least, mm", "most, mm")
    rows = [
        (
            *(each.segment, each.n, f"{each.mean_mm:+.3f}", f"{each.sd_mm:.3f}", f"{each.rms_mm:.3f}"),
            *(f"{each.min_mm:+.3f}", f"{each.max_mm:+.3f}"),
        )
        for each in found
    ]
    note = (
        "Of the scan's vertices by the segment of the closest design point; area-weighted. Colours as in the pictures "
        "of the segments."
    )
    colours = [hex_of(palette.of_segment(each.segment)) for each in found]
    return [Table("Deviation by segment of the design", columns, rows, frozenset(columns[1:]), note, colours)]


def pose(found: Transform | None) -> list[Table]:
    """The matrix, ready to be copied; nothing without a pose."""
    if found is None:
        return []
    rows = [[f"{value:.6f}" for value in row[:3]] + [f"{row[3]:.4f}"] for row in found.matrix]
    columns = ("x", "y", "z", "shift, mm")
    note = (
        f"{found.convention}: a turn by {found.rotation_deg:.3f}° and a shift, both in mm. In full precision, and for the "
        "files' own units, in results.json."
    )
    return [Table("Pose of the scan on the design", columns, rows, frozenset(columns), note)]


def registration(result: RegistrationResult) -> Table:
    """The four RMSEs and what goes with them."""
    metrics = result.metrics
    rows = [
        ("RMSE as uploaded", mm(metrics.rmse_initial_mm)),
        ("RMSE by landmarks alone", mm(metrics.rmse_landmarks_mm)),
        ("RMSE by ICP of the whole shape, without landmarks", mm(metrics.rmse_complete_mm)),
        ("K, the ratio of the two", "-" if metrics.k_ratio is None else f"{metrics.k_ratio:.3g}"),
        ("RMSE of the final pose", mm(metrics.rmse_mm)),
        ("scan within the inlier distance", "-" if metrics.fitness is None else f"{metrics.fitness:.1%}"),
        ("inlier distance", mm(metrics.inlier_distance_mm)),
    ]
    if result.scale is not None:
        size = "-" if result.scale.isotropic is None else f"{result.scale.isotropic:.5f}"
        rows.append(("size of the scan over the design (not applied)", size))
        rows.append(("warp that stays", mm(result.scale.warp_mm)))
    note = "RMSE: area-weighted, every vertex of the cleaned scan, nothing left out."
    return Table("Registration", ("what", "value"), rows, frozenset({"value"}), note)


def alternatives(found: Sequence[Alternative], *, rejected: bool) -> list[Table]:
    """rejected : there is no pose to stand by, and these are what was tried"""
    if not found:
        return []
    rows = [
        (
            number + 1,
            f"{each.score:.3g}",
            mm(each.rmse_mm),
            "symmetry of the design" if each.symmetry_of_design else "rejected" if rejected else "rival",
        )
        for number, each in enumerate(found)
    ]
    title = "Poses that were tried and rejected" if rejected else "Other poses"
    note = "Score: cost over that of the best pose, 1 is as good."
    return [Table(title, ("number", "score", "RMSE", "what it is"), rows, frozenset({"score", "RMSE"}), note)]


def segments(found: Segments) -> Table:
    columns = ("segment", "rho of its centre", "delta, mm", "vertices", "centre, mm")
    rows = [
        (each.segment, f"{each.rho:.4g}", f"{each.delta:.3f}", each.size, point(each.position_mm))
        for each in found.centres
    ]
    return Table(
        "Segments",
        columns,
        rows,
        frozenset(columns[1:]),
        f"Metric {found.metric}, density {found.density}, d_c {found.d_c:.3f} mm, halo {found.halo_fraction:.0%}.",
        [hex_of(palette.of_segment(each.segment)) for each in found.centres],
    )


def landmarks(result: LandmarksResult) -> Table:
    marked = result.landmarks.mesh
    columns = ("id", "segment", "T²", "strength", "position, mm", "vertex")
    return Table(
        "Landmarks",
        columns,
        [
            (
                each.id,
                each.segment,
                f"{each.t2:.2f}",
                f"{each.strength:.2f}",
                point(each.position_mm),
                each.vertex,
            )
            for each in marked
        ],
        frozenset(columns[2:]),
        "Strength: T² over its limit. The vertex is one of mesh.clean.ply.",
        [hex_of(palette.of_segment(each.segment)) for each in marked],
    )


def provenance(inputs: dict[str, Input], made_by: MadeBy) -> Table:
    rows: list[Sequence[object]] = [
        (name, given.format, given.unit, given.sha256) for name, given in inputs.items()
    ]
    note = f"Cusp {made_by.version}, seed {made_by.seed}. All settings and libraries are in results.json."
    return Table("Provenance", ("mesh", "format", "unit", "SHA-256"), rows, frozenset(), note)


def hex_of(colour: FloatArray) -> str:
    return "#" + "".join(f"{round(255 * float(part)):02x}" for part in colour)


def mm(value: float | None) -> str:
    return "-" if value is None else f"{value:.3f} mm"


def point(position_mm: Sequence[float]) -> str:
    return ", ".join(f"{x:.2f}" for x in position_mm)
