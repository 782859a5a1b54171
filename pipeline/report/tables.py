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
    RegistrationResult,
    ScanQuality,
    SegmentDeviation,
    Segments,
    Transform,
    Verdict,
)
from pipeline.report import palette
from pipeline.report.words import ENGLISH, Words


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


@dataclass(frozen=True, slots=True)
class Line:
    """A sentence with its title before it."""

    title: str
    text: str
    kind: str = "line"


#: The two probabilities of a verdict: field, and what each is of.
PROBABILITIES = (
    ("same_part", "probability that the scan is of this design"),
    ("pose", "probability that the pose is right, if it is"),
)
NOT_GIVEN = "not given"
TO_POINTS = (
    "The scan is a point cloud: from the design the distance is to the nearest point, so it includes the "
    "spacing of the points."
)


def evidence(verdict: Verdict, words: Words = ENGLISH) -> list[Table]:
    """One table for each of the two probabilities; none for a verdict without evidence."""
    if not verdict.evidence:
        return []
    columns = tuple(words(name) for name in ("evidence", "value", "weight", "contribution"))
    columns = (*columns, words("what it measures"))
    return [
        Table(
            f"{words(of.replace('_', ' '))}: {probability(getattr(verdict, of), words)}",
            columns,
            [_evidence_row(each, words) for each in verdict.evidence if each.of == of],
            frozenset(columns[1:4]),
            words(note),
        )
        for of, note in PROBABILITIES
    ]


def _evidence_row(each: Evidence, words: Words) -> tuple[str, ...]:
    amount = words.signed(each.contribution, 2)
    is_zero = abs(each.contribution) < 0.005
    side = words("neutral") if is_zero else words("for") if each.contribution > 0 else words("against")
    name, detail = words(each.name.replace("_", " ")), words(each.detail)
    return (name, words.fixed(each.value, 2), words.fixed(each.weight, 2), f"{side} {amount}", detail)


def probability(value: float | None, words: Words = ENGLISH) -> str:
    """`0.97`; null where the settings differ from those that the models were fitted with."""
    return words(NOT_GIVEN) if value is None else words.fixed(value, 2)


def both_ways(
    scan: Deviation, design: DesignDeviation | None, words: Words = ENGLISH, *, is_cloud: bool = False
) -> Table:
    """Deviation statistics in both directions: over the scan's vertices, and over the design's. is_cloud : of
    a scan without triangles
    """

    def both(low: float, high: float) -> str:
        return f"{words.signed(low)} {words('to')} {words.signed(high)} mm"

    statistics: list[tuple[str, Callable[[Distances], str]]] = [
        (words("vertices counted"), lambda each: str(each.n)),
        (words("mean (SD)"), lambda each: f"{words.signed(each.mean_mm)} ({words.fixed(each.sd_mm)}) mm"),
        ("RMS", lambda each: words.millimetres(each.rms_mm)),
        (words("1 % to 99 % quantile"), lambda each: both(each.p01_mm, each.p99_mm)),
        (words("min to max"), lambda each: both(each.min_mm, each.max_mm)),
        (words("within, above, below the tolerance"), lambda each: _by_tolerance(each, words)),
    ]
    rows: list[tuple[str, ...]] = [
        (name, text(scan), "-" if design is None else text(design)) for name, text in statistics
    ]
    if design is not None:
        rows.insert(0, (words("share of the design that is counted"), "", words.percent(design.seen)))
    columns = ("", words("scan to design"), words("design to scan"))
    note = words("From the design to the scan it shows what is missing: a broken piece, or a filled hole.")
    if is_cloud:
        note += " " + words(TO_POINTS)
    return Table(words("Deviation in both directions"), columns, rows, frozenset(columns[1:]), note)


def _by_tolerance(distances: Distances, words: Words) -> str:
    if distances.within is None or distances.above is None or distances.below is None:
        return words("no tolerance was given")
    return " / ".join(words.percent(share) for share in (distances.within, distances.above, distances.below))


def by_segment(deviations: Sequence[SegmentDeviation], words: Words = ENGLISH) -> list[Table]:
    """One row for each segment of the design; no table without segments."""
    if not deviations:
        return []
    columns = (
        *(words("segment"), words("vertices"), words("mean, mm"), words("SD, mm"), words("RMS, mm")),
        *(words("min, mm"), words("max, mm")),
    )
    rows = [
        (
            *(each.segment, each.n, words.signed(each.mean_mm)),
            *(words.fixed(each.sd_mm), words.fixed(each.rms_mm)),
            *(words.signed(each.min_mm), words.signed(each.max_mm)),
        )
        for each in deviations
    ]
    note = words("Of the scan's vertices, by area, by the segment of the nearest design point.")
    colours = [hex_of(palette.of_segment(each.segment)) for each in deviations]
    title = words("Deviation by segment of the design")
    return [Table(title, columns, rows, frozenset(columns[1:]), note, colours)]


def pose(transform: Transform | None, words: Words = ENGLISH) -> list[Table]:
    """The matrix; no table without a pose."""
    if transform is None:
        return []
    rows = [
        [words.fixed(value, 6) for value in row[:3]] + [words.fixed(row[3], 4)]
        for row in transform.matrix[:3]
    ]
    columns = ("x", "y", "z", words("translation, mm"))
    note = words(
        "{convention}: a rotation by {angle}° and a translation. results.json has it in full precision, and "
        "in the units of the files.",
        convention=transform.convention,
        angle=words.fixed(transform.rotation_deg),
    )
    return [Table(words("Pose of the scan on the design"), columns, rows, frozenset(columns), note)]


def registration(result: RegistrationResult, words: Words = ENGLISH) -> Table:
    """The RMSEs of the four poses, and the figures that belong to them."""
    metrics = result.metrics
    rows = [
        (words("RMSE as uploaded"), words.millimetres(metrics.rmse_initial_mm)),
        (words("RMSE of the landmark alignment"), words.millimetres(metrics.rmse_landmarks_mm)),
        (
            words("RMSE of ICP of the complete shape, without landmarks"),
            words.millimetres(metrics.rmse_complete_mm),
        ),
        (
            words("K, the ratio of the two"),
            "-" if metrics.k_ratio is None else words.short(metrics.k_ratio),
        ),
        (words("RMSE of the final pose"), words.millimetres(metrics.rmse_mm)),
        (words("inlier distance"), words.millimetres(metrics.inlier_distance_mm)),
        (words("share of the scan within the inlier distance"), words.percent(metrics.fitness)),
        (words("the same, without open borders of the design"), words.percent(metrics.scan_overlap)),
        (
            words("share of the design within the inlier distance of the scan"),
            words.percent(metrics.design_coverage),
        ),
    ]
    if result.scale is not None:
        rows.append((words("residual deformation"), words.millimetres(result.scale.warp_mm)))
    if result.scan is not None:
        rows += _scan_quality(result.scan, words)
    note = words("RMSE: area-weighted, over every vertex of the cleaned scan, without excluding outliers.")
    value = words("value")
    return Table(words("Registration"), (words("quantity"), value), rows, frozenset({value}), note)


def _scan_quality(scan: ScanQuality, words: Words) -> list[tuple[str, str]]:
    accuracy = words("not stated") if scan.accuracy_mm is None else f"{words.short(scan.accuracy_mm)} mm"
    return [
        (words("noise of the scan (1 sigma, from local surface fits)"), words.millimetres(scan.noise_mm)),
        (words("stated accuracy of the scanner (1 sigma)"), accuracy),
        (words("residual limit for the verdict ok"), words.millimetres(scan.residual_limit_mm)),
        (words("share of the scan left out as stray pieces"), words.percent(scan.left_out_share)),
    ]


def alternatives(
    poses: Sequence[Alternative], *, rejected: bool, words: Words = ENGLISH
) -> list[Table | Line]:
    """Alternative poses; the equivalent ones as one line. rejected : no valid alignment was found, and these
    are the rejected candidates
    """
    found: list[Table | Line] = []
    others = [each for each in poses if not each.symmetry_of_design]
    equivalent = sum(each.equivalent_poses for each in poses if each.symmetry_of_design)
    if equivalent:
        text = words(
            "{count} besides this one, by symmetry of the design: each is equally correct.", count=equivalent
        )
        found.append(Line(words("Equivalent poses"), text))
    if not others:
        return found
    cost, rmse = words("cost over that of the best"), "RMSE"
    rows = [
        (number, words.short(each.score), words.millimetres(each.rmse_mm))
        for number, each in enumerate(others, start=1)
    ]
    title = words("Rejected poses") if rejected else words("Alternative poses")
    note = words("A cost of 1 is as good as the best pose.")
    return [*found, Table(title, (words("number"), cost, rmse), rows, frozenset({cost, rmse}), note)]


def segments(result: Segments, words: Words = ENGLISH) -> Table:
    """The centres of the segments, one row each."""
    columns = (
        *(words("segment"), words("rho of its centre"), words("delta, mm"), words("vertices")),
        words("centre, mm"),
    )
    rows = [
        (
            *(each.segment, words.short(each.rho, 4), words.fixed(each.delta), each.size),
            words.point(each.position_mm),
        )
        for each in result.centres
    ]
    return Table(
        words("Segments"),
        columns,
        rows,
        frozenset(columns[1:]),
        words(
            "Metric {metric}, density {density}, d_c {d_c} mm, halo {halo}.",
            metric=result.metric,
            density=result.density,
            d_c=words.fixed(result.d_c),
            halo=words.percent(result.halo_fraction, 0),
        ),
        [hex_of(palette.of_segment(each.segment)) for each in result.centres],
    )


def landmarks(result: LandmarksResult, words: Words = ENGLISH) -> Table:
    """The landmarks, strongest first."""
    columns = ("id", words("segment"), "T²", words("strength"), words("position, mm"), words("vertex"))
    rows = [
        (
            *(each.id, each.segment, words.fixed(each.t2, 2), words.fixed(each.strength, 2)),
            *(words.point(each.position_mm), each.vertex),
        )
        for each in result.landmarks.mesh
    ]
    return Table(
        words("Landmarks"),
        columns,
        rows,
        frozenset(columns[2:]),
        words("Strength: T² divided by its limit. The vertex numbers refer to mesh.clean.ply."),
        [hex_of(palette.of_segment(each.segment)) for each in result.landmarks.mesh],
    )


def provenance(inputs: dict[str, Input], made_by: MadeBy, words: Words = ENGLISH) -> Table:
    """Input files with their hashes, and the version that made the result."""
    rows: list[Sequence[object]] = [
        (words(name), file.format, file.unit, file.sha256) for name, file in inputs.items()
    ]
    note = words(
        "Cusp {version}, seed {seed}. results.json lists all settings and library versions.",
        version=made_by.version,
        seed=made_by.seed,
    )
    columns = (words("mesh"), words("format"), words("unit"), "SHA-256")
    return Table(words("Provenance"), columns, rows, frozenset(), note)


def hex_of(colour: FloatArray) -> str:
    """`#rrggbb` of a colour (3,) in [0, 1]."""
    return "#" + "".join(f"{round(255 * float(part)):02x}" for part in colour)
