"""The inspection on the report page: the decision, its checks, the extreme places, and which part it was."""

from collections.abc import Mapping

from pipeline.core.reference import Reference
from pipeline.core.report_header import ReportHeader
from pipeline.core.results import Check, Decision, Inspection
from pipeline.report.tables import Table
from pipeline.report.words import ENGLISH, Words

#: Words and style of the decision box.
DECISIONS: dict[Decision, tuple[str, str]] = {
    "pass": ("pass", "good"),
    "fail": ("fail", "bad"),
    "not_judged": ("not judged", "warn"),
}
AREA = "Area: the surface around it that deviates by at least half of this."
PASSED = {True: "passed", False: "failed", None: "not judged"}


def decision_box(inspection: Inspection | None, words: Words = ENGLISH) -> dict[str, object] | None:
    """What the box says; none in a report of an earlier version."""
    if inspection is None:
        return None
    said, mood = DECISIONS[inspection.decision]
    count = len(inspection.checks)
    passed = sum(check.passed is True for check in inspection.checks)
    return {
        "words": words(said),
        "mood": mood,
        "counts": words("{passed} of {count} checks passed", passed=passed, count=count) if count else "",
        "reasons": [words.sentence(each) for each in inspection.reasons],
    }


def check_tables(inspection: Inspection | None, words: Words = ENGLISH) -> list[Table]:
    """The checks with their limits; none without any."""
    if inspection is None or not inspection.checks:
        return []
    numbers = (words("value"), words("standard error"), words("lower limit"), words("upper limit"))
    columns = (words("check"), *numbers, words("result"), words("at x, y, z (design), mm"))
    rule = words.sentence(inspection.rule or "-")
    return [
        Table(
            words("Checks"),
            columns,
            [_check_row(check, words) for check in inspection.checks],
            frozenset(numbers),
            f"{_patch(inspection, words)} {words('Decision rule')}: {rule}.",
        )
    ]


def extreme_tables(inspection: Inspection | None, words: Words = ENGLISH) -> list[Table]:
    """Where the surface deviates most; none without a pose."""
    if inspection is None or not inspection.extremes:
        return []
    numbers = (words("deviation, mm"), words("standard error, mm"), words("area, mm²"), words("segment"))
    return [
        Table(
            words("Largest deviations"),
            (*numbers, words("at x, y, z (design), mm")),
            [
                (
                    words.signed(each.value_mm),
                    "-" if each.uncertainty_mm is None else words.fixed(each.uncertainty_mm),
                    words.short(each.area_mm2),
                    str(each.segment),
                    words.point(each.position_mm),
                )
                for each in inspection.extremes
            ],
            frozenset(numbers),
            f"{_patch(inspection, words)} {words(AREA)}",
        )
    ]


def _patch(inspection: Inspection, words: Words) -> str:
    if inspection.patch_mm is None:
        return ""
    return words(
        "Medians over patches of {size} mm diameter; min and max are single vertices.",
        size=words.short(inspection.patch_mm),
    )


def identity(
    reference: Reference | None, header: ReportHeader, words: Words = ENGLISH
) -> list[tuple[str, str]]:
    """Name and value of what tells which part this was, of which files, which job and when."""
    given: Mapping[str, str] = {}
    if reference is not None:
        given = reference.model_dump(exclude_none=True, exclude={"more"}) | reference.more
    rows = [(words(key.replace("_", " ")), str(value)) for key, value in given.items()]
    rows += [(words(role), name) for role, name in header.files.items()]
    if header.created is not None:
        rows.append((words("date"), words.date(header.created)))
    if header.job is not None:
        rows.append((words("job"), header.job))
    return rows


def _name(check: Check, words: Words) -> str:
    """Of a point or distance as given; else the kind, after the name of its region."""
    if check.kind in ("point", "distance"):
        return check.name
    return words(check.kind) if check.region is None else f"{check.region}: {words(check.kind)}"


def _check_row(check: Check, words: Words) -> tuple[str, ...]:
    def shown(value: float | None) -> str:
        if value is None:
            return "-"
        return words.percent(value) if check.unit == "1" else f"{words.signed(value)} mm"

    error = words.millimetres(check.uncertainty) if check.unit == "mm" else words.percent(check.uncertainty)
    place = "-" if check.position_mm is None else words.point(check.position_mm)
    return (
        *(_name(check, words), shown(check.value), error, shown(check.lower), shown(check.upper)),
        *(words(PASSED[check.passed]), place),
    )
