"""The inspection on the report page: the decision, its checks, the extreme places, and which part it was."""

from pipeline.core.reference import Reference
from pipeline.core.results import Check, Decision, Inspection
from pipeline.report.numbers import millimetres, percent, signed
from pipeline.report.tables import Table

#: Words and style of the decision box.
DECISIONS: dict[Decision, tuple[str, str]] = {
    "pass": ("pass", "good"),
    "fail": ("fail", "bad"),
    "not_judged": ("not judged", "warn"),
}
PASSED = {True: "passed", False: "failed", None: "not judged"}


def decision_box(inspection: Inspection | None) -> dict[str, object] | None:
    """What the box says; none in a report of an earlier version."""
    if inspection is None:
        return None
    words, mood = DECISIONS[inspection.decision]
    return {"words": words, "mood": mood, "reasons": inspection.reasons, "rule": inspection.rule}


def check_tables(inspection: Inspection | None) -> list[Table]:
    """The checks with their limits; none without any."""
    if inspection is None or not inspection.checks:
        return []
    return [
        Table(
            "Checks",
            ("check", "value", "standard error", "lower limit", "upper limit", "result", "at, mm (design)"),
            [_check_row(check) for check in inspection.checks],
            frozenset({"value", "standard error", "lower limit", "upper limit"}),
            f"{_patch(inspection)} Decision rule: {inspection.rule}.",
        )
    ]


def extreme_tables(inspection: Inspection | None) -> list[Table]:
    """Where the surface deviates most; none without a pose."""
    if inspection is None or not inspection.extremes:
        return []
    return [
        Table(
            "Largest deviations",
            ("deviation, mm", "standard error, mm", "area, mm²", "segment", "at, mm (design)"),
            [
                (
                    signed(each.value_mm),
                    _or_dash(each.uncertainty_mm),
                    f"{each.area_mm2:.3g}",
                    str(each.segment),
                    _place(each.position_mm),
                )
                for each in inspection.extremes
            ],
            frozenset({"deviation, mm", "standard error, mm", "area, mm²", "segment"}),
            f"{_patch(inspection)} The area deviates by at least half as much.",
        )
    ]


def _patch(inspection: Inspection) -> str:
    if inspection.patch_mm is None:
        return ""
    return f"Deviations are medians over patches of {inspection.patch_mm:.3g} mm diameter."


def reference_table(reference: Reference | None) -> list[Table]:
    """Key and value of each that was given."""
    if reference is None:
        return []
    given = reference.model_dump(exclude_none=True, exclude={"more"}) | reference.more
    rows = [(key.replace("_", " "), value) for key, value in given.items()]
    return [Table("Part", ("key", "value"), rows)] if rows else []


def _check_row(check: Check) -> tuple[str, ...]:
    def shown(value: float | None) -> str:
        if value is None:
            return "-"
        return percent(value) if check.unit == "1" else f"{signed(value)} mm"

    error = millimetres(check.uncertainty) if check.unit == "mm" else percent(check.uncertainty)
    place = "-" if check.position_mm is None else _place(check.position_mm)
    return (
        *(check.name, shown(check.value), error, shown(check.lower), shown(check.upper)),
        *(PASSED[check.passed], place),
    )


def _or_dash(value: float | None) -> str:
    return "-" if value is None else f"{value:.3f}"


def _place(position_mm: list[float]) -> str:
    return ", ".join(signed(axis, 2).removeprefix("+") for axis in position_mm)
