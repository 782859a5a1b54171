"""Q-DAS files, read back by the reader of others and line by line."""

import aqdefreader
import pytest
from pydantic import ValidationError

from pipeline.core.reference import Reference
from pipeline.core.results import Check
from pipeline.inspection.qdas import dfq

REFERENCE = Reference(
    part_number="BR-7",
    serial="A-17",
    batch="2026-11",
    order="4711",
    machine="SLA 2",
    operator="Jürgen",
    gauge="scanner 3",
    measured_at="2026-11-27T14:16:01+01:00",
    more={"part_name": "bracket"},
)


def check(
    name: str, value: float | None, lower: float | None, upper: float | None, unit: str = "mm"
) -> Check:
    fields = {
        "kind": "point",
        "region": None,
        "uncertainty": None,
        "n": 9,
        "passed": True,
        "position_mm": None,
    }
    given = {"name": name, "value": value, "lower": lower, "upper": upper, "unit": unit}
    return Check.model_validate(fields | given)


CHECKS = [
    check("rim: highest", 0.123456789, None, 0.3),
    check("P1", -0.00002, -0.1, 0.1),
    check("coverage", 0.93, 0.8, None, "1"),
    check("P2", None, -0.1, 0.1),
]


def test_another_reader_finds_part_characteristics_and_values() -> None:
    file = aqdefreader.DfqFile(dfq(CHECKS, REFERENCE).decode("utf-8-sig").splitlines())
    assert file.part_count() == 1
    part = file.get_part(0)
    assert (part.get_data("K1001"), part.get_data("K1002")) == ("BR-7", "bracket")
    for number, each in enumerate(CHECKS, start=1):
        found = part.get_characteristic_by_index(number)
        assert (found.get_data("K2001"), found.get_data("K2002")) == (number, each.name)
        limits = [found.get_data(key) for key in ("K2101", "K2110", "K2111")]
        nominal = 0.0 if each.unit == "mm" else 1.0
        assert [None if value is None else float(value) for value in limits] == [
            nominal,
            each.lower,
            each.upper,
        ]
        (value,) = found.get_measurements()
        assert float(value.value) == pytest.approx(each.value or 0.0, abs=1e-12)
        assert value.attribute == (255 if each.value is None else 0)
        assert value.datetime.isoformat() == "2026-11-27T14:16:01"


def test_every_value_says_which_part_it_is_of() -> None:
    content = dfq(CHECKS, REFERENCE)
    lines = dict(line.split(" ", 1) for line in content.decode("utf-8-sig").split("\r\n")[:-1])
    assert lines["K0100"] == "4"
    for number in range(1, 5):
        keys = ("K0006", "K0008", "K0010", "K0012", "K0014", "K0053")
        found = [lines[f"{key}/{number}"] for key in keys]
        assert found == ["2026-11", "Jürgen", "SLA 2", "scanner 3", "A-17", "4711"]
    assert content == dfq(CHECKS, REFERENCE)


def test_a_part_of_which_nothing_is_known_is_written_too() -> None:
    lines = dfq(CHECKS[:1], None).decode("utf-8-sig").split("\r\n")
    assert "K1001 unknown" in lines
    assert not [line for line in lines if line.startswith(("K0004", "K0014"))]


@pytest.mark.parametrize("text", ["yesterday", "2026-11-27", "27.11.2026 10:00"])
def test_a_time_must_be_one(text: str) -> None:
    with pytest.raises(ValidationError, match="measured_at"):
        Reference(measured_at=text)
