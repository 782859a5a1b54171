"""The tables of the report page, from the result records; lengths in mm."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

from pipeline.core.mesh import FloatArray
from pipeline.core.results import (
    Alternative,
    DesignDeviation,
    Deviation,
    Distances,
    Evidence,
    Input,
    LandmarksResult,
    MadeBy,
    Metrics,
    RegistrationResult,
    ScanQuality,
    SegmentDeviation,
    Segments,
    Transform,
    Verdict,
)
from pipeline.report import palette
from pipeline.report.numbers import fixed, millimetres, percent, signed


@dataclass(frozen=True, slots=True)
class Table:
    """Columns listed in `numbers` are right-aligned; colours : `#rrggbb` of a swatch before each row, or
    none.
    """

    title: str
    columns: Sequence[str]
    rows: Sequence[Sequence[object]]
    numbers: frozenset[str] = frozenset()
    note: str = ""
    colours: Sequence[str] = field(default_factory=list)
    kind: str = "table"  # of section, for the template


#: The two probabilities of a verdict: field, and what each is of.
PROBABILITIES = (
    ("same_part", "probability that the scan is of this design"),
    ("pose", "probability that the pose is right, if it is"),
)
NOT_GIVEN = "not given"


def evidence(verdict: Verdict) -> list[Table]:
    """One table for each of the two probabilities; none for a verdict without evidence."""
    if not verdict.evidence:
        return []
    columns = ("evidence", "value", "weight", "contribution", "what it measures")
    numbers = frozenset(columns[1:4])
    return [
        Table(
            f"{of.replace('_', ' ')}: {probability(getattr(verdict, of))}",
            columns,
            [_evidence_row(each) for each in verdict.evidence if each.of == of],
            numbers,
            note,
        )
        for of, note in PROBABILITIES
    ]


def _evidence_row(each: Evidence) -> tuple[str, ...]:
    amount = signed(each.contribution, 2)
    side = "neither" if not amount.strip("0.") else "for" if each.contribution > 0 else "against"
    name = each.name.replace("_", " ")
    return (name, fixed(each.value, 2), fixed(each.weight, 2), f"{side} {amount}", each.detail)


def probability(value: float | None) -> str:
    """`0.97`; null where the settings differ from those that the models were fitted with."""
    return NOT_GIVEN if value is None else f"{value:.2f}"


def both_ways(scan: Deviation, design: DesignDeviation | None, metrics: Metrics) -> Table:
    """Deviation statistics in both directions: over the scan's vertices, and over the design's."""
    overlap = (
        None
        if metrics.scan_overlap is None
        else f"{percent(metrics.scan_overlap)} within the inlier distance"
    )
    coverage = None if design is None else f"{percent(design.seen)} covered by the scan"
    statistics: list[tuple[str, Callable[[Distances], str]]] = [
        ("vertices counted", lambda each: str(each.n)),
        ("mean (SD)", lambda each: f"{signed(each.mean_mm)} ({fixed(each.sd_mm)}) mm"),
        ("RMS", lambda each: millimetres(each.rms_mm)),
        ("1 % to 99 % quantile", lambda each: f"{signed(each.p01_mm)} to {signed(each.p99_mm)} mm"),
        ("min, max", lambda each: f"{signed(each.min_mm)}, {signed(each.max_mm)} mm"),
        ("within, above, below the tolerance", _by_tolerance),
    ]
    rows: list[tuple[str, ...]] = [
        ("area", overlap or "-", coverage or "-"),
        *((name, text(scan), "-" if design is None else text(design)) for name, text in statistics),
    ]
    return Table(
        "Deviation in both directions",
        ("", "scan to design", "design to scan"),
        rows,
        frozenset({"scan to design", "design to scan"}),
        "The distances from the design to the scan show missing regions: a broken piece or a filled hole.",
    )


def _by_tolerance(distances: Distances) -> str:
    if distances.within is None or distances.above is None or distances.below is None:
        return "no tolerance was specified"
    return f"{percent(distances.within)}, {percent(distances.above)}, {percent(distances.below)}"


def by_segment(deviations: Sequence[SegmentDeviation]) -> list[Table]:
    """One row for each segment of the design; no table without segments."""
    if not deviations:
        return []
    columns = ("segment", "vertices", "mean, mm", "SD, mm", "RMS, mm", "min, mm", "max, mm")
    rows = [
        (
            *(each.segment, each.n, signed(each.mean_mm), fixed(each.sd_mm), fixed(each.rms_mm)),
            *(signed(each.min_mm), signed(each.max_mm)),
        )
        for each in deviations
    ]
    note = (
        "Area-weighted statistics of the scan's vertices, by the segment of the closest design point. "
        "The colours match the pictures of the segments."
    )
    colours = [hex_of(palette.of_segment(each.segment)) for each in deviations]
    return [Table("Deviation by segment of the design", columns, rows, frozenset(columns[1:]), note, colours)]


def pose(transform: Transform | None) -> list[Table]:
    """The matrix; no table without a pose."""
    if transform is None:
        return []
    rows = [[fixed(value, 6) for value in row[:3]] + [fixed(row[3], 4)] for row in transform.matrix]
    columns = ("x", "y", "z", "translation, mm")
    note = (
        f"{transform.convention}: a rotation by {fixed(transform.rotation_deg)}° and a translation, in mm. "
        "results.json contains the matrix in full precision and in the units of the files."
    )
    return [Table("Pose of the scan relative to the design", columns, rows, frozenset(columns), note)]


def registration(result: RegistrationResult) -> Table:
    """The RMSEs of the four poses, and the figures that belong to them."""
    metrics = result.metrics
    rows = [
        ("RMSE as uploaded", millimetres(metrics.rmse_initial_mm)),
        ("RMSE of the landmark alignment", millimetres(metrics.rmse_landmarks_mm)),
        ("RMSE of ICP of the complete shape, without landmarks", millimetres(metrics.rmse_complete_mm)),
        ("K, the ratio of the two", "-" if metrics.k_ratio is None else f"{metrics.k_ratio:.3g}"),
        ("RMSE of the final pose", millimetres(metrics.rmse_mm)),
        ("scan within the inlier distance", percent(metrics.fitness)),
        ("inlier distance", millimetres(metrics.inlier_distance_mm)),
    ]
    if result.scale is not None:
        size = "-" if result.scale.isotropic is None else fixed(result.scale.isotropic, 5)
        rows.append(("scale of the scan relative to the design (not applied)", size))
        rows.append(("residual deformation", millimetres(result.scale.warp_mm)))
    if result.scan is not None:
        rows += _scan_quality(result.scan)
    note = "RMSE: area-weighted, over every vertex of the cleaned scan, without excluding outliers."
    return Table("Registration", ("quantity", "value"), rows, frozenset({"value"}), note)


def _scan_quality(scan: ScanQuality) -> list[tuple[str, str]]:
    accuracy = "not stated" if scan.accuracy_mm is None else f"{scan.accuracy_mm:g} mm"
    return [
        ("noise of the scan (1 sigma, from local surface fits)", millimetres(scan.noise_mm)),
        ("stated accuracy of the scanner (1 sigma)", accuracy),
        ("residual limit for the verdict ok", millimetres(scan.residual_limit_mm)),
        ("share of the scan left out as stray pieces", percent(scan.left_out_share)),
    ]


def alternatives(poses: Sequence[Alternative], *, rejected: bool) -> list[Table]:
    """Alternative poses. rejected : no valid alignment was found, and these are the rejected candidates"""
    if not poses:
        return []
    rows = [
        (
            number + 1,
            f"{each.score:.3g}",
            millimetres(each.rmse_mm),
            _type_of(each, rejected=rejected),
        )
        for number, each in enumerate(poses)
    ]
    title = "Rejected poses" if rejected else "Alternative poses"
    note = "Score: cost relative to that of the best pose; 1 means equally good."
    return [Table(title, ("number", "score", "RMSE", "type"), rows, frozenset({"score", "RMSE"}), note)]


def _type_of(pose: Alternative, *, rejected: bool) -> str:
    if not pose.symmetry_of_design:
        return "rejected" if rejected else "alternative pose"
    count = pose.equivalent_poses
    return "symmetry of the design" + (f", stands for {count} equivalent poses" if count > 1 else "")


def segments(result: Segments) -> Table:
    """The centres of the segments, one row each."""
    columns = ("segment", "rho of its centre", "delta, mm", "vertices", "centre, mm")
    rows = [
        (each.segment, f"{each.rho:.4g}", fixed(each.delta), each.size, point(each.position_mm))
        for each in result.centres
    ]
    return Table(
        "Segments",
        columns,
        rows,
        frozenset(columns[1:]),
        f"Metric {result.metric}, density {result.density}, d_c {fixed(result.d_c)} mm, "
        f"halo {percent(result.halo_fraction, 0)}.",
        [hex_of(palette.of_segment(each.segment)) for each in result.centres],
    )


def landmarks(result: LandmarksResult) -> Table:
    """The landmarks, strongest first."""
    columns = ("id", "segment", "T²", "strength", "position, mm", "vertex")
    rows = [
        (
            *(each.id, each.segment, fixed(each.t2, 2), fixed(each.strength, 2)),
            *(point(each.position_mm), each.vertex),
        )
        for each in result.landmarks.mesh
    ]
    return Table(
        "Landmarks",
        columns,
        rows,
        frozenset(columns[2:]),
        "Strength: T² divided by its limit. The vertex numbers refer to mesh.clean.ply.",
        [hex_of(palette.of_segment(each.segment)) for each in result.landmarks.mesh],
    )


def provenance(inputs: dict[str, Input], made_by: MadeBy) -> Table:
    """Input files with their hashes, and the version that made the result."""
    rows: list[Sequence[object]] = [
        (name, file.format, file.unit, file.sha256) for name, file in inputs.items()
    ]
    note = (
        f"Cusp {made_by.version}, seed {made_by.seed}. results.json lists all settings and library versions."
    )
    return Table("Provenance", ("mesh", "format", "unit", "SHA-256"), rows, frozenset(), note)


def hex_of(colour: FloatArray) -> str:
    """`#rrggbb` of a colour (3,) in [0, 1]."""
    return "#" + "".join(f"{round(255 * float(part)):02x}" for part in colour)


def point(position_mm: Sequence[float]) -> str:
    """`1.20, −3.00, 0.00`, mm."""
    return ", ".join(fixed(x, 2) for x in position_mm)
