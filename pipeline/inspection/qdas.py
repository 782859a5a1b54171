"""Q-DAS ASCII transfer format (AQDEF): the checks of one part, for statistics programs.

Keys: K1xxx the part, K2xxx/i characteristic i, K00xx/i its value and which part and measurement it is of.
Deviations have the nominal 0, shares the nominal 1. Lines end in CR LF; the text is UTF-8 with its mark.
"""

from collections.abc import Iterator, Sequence
from datetime import datetime

from pipeline.core.reference import Reference
from pipeline.core.results import Check

NAME = "characteristics.dfq"
#: K0002 of a value that does not count, and decimal places that are shown (K2022): 0.1 micrometres.
NOT_MEASURED, PLACES = 255, 4
#: The unit, as K2142 says it.
UNITS = {"mm": "mm", "1": "1"}


def dfq(checks: Sequence[Check], reference: Reference | None) -> bytes:
    """The file. One part, a characteristic and a value for each check."""
    return "".join(f"{line}\r\n" for line in _lines(checks, reference or Reference())).encode("utf-8-sig")


def _lines(checks: Sequence[Check], reference: Reference) -> Iterator[str]:
    yield f"K0100 {len(checks)}"
    yield f"K1001 {_text(reference.part_number or 'unknown')}"
    yield f"K1002 {_text(reference.more.get('part_name') or reference.part_number or 'unknown')}"
    for number, check in enumerate(checks, start=1):
        fields = {
            "K2001": str(number),
            "K2002": _text(check.name),
            "K2022": str(PLACES),
            "K2101": _decimal(0.0 if check.unit == "mm" else 1.0),
            "K2110": _decimal(check.lower),
            "K2111": _decimal(check.upper),
            "K2142": UNITS[check.unit],
        }
        yield from (f"{key}/{number} {value}" for key, value in fields.items() if value)
    for number, check in enumerate(checks, start=1):
        of_value = {
            "K0001": _decimal(0.0 if check.value is None else check.value),
            "K0002": str(0 if check.value is not None else NOT_MEASURED),
            "K0004": _time(reference.measured_at),
            "K0006": _text(reference.batch),
            "K0008": _text(reference.operator),
            "K0010": _text(reference.machine),
            "K0012": _text(reference.gauge),
            "K0014": _text(reference.serial),
            "K0053": _text(reference.order),
        }
        yield from (f"{key}/{number} {value}" for key, value in of_value.items() if value)


def _text(value: str | None) -> str:
    """On one line."""
    return "" if value is None else " ".join(value.split())


def _decimal(value: float | None) -> str:
    """Shortest digits that give the same number back, never with an exponent."""
    if value is None:
        return ""
    return f"{value:.12f}".rstrip("0").rstrip(".") if value != 0 else "0"


def _time(text: str | None) -> str:
    """Day, month, year and time, as it was stated: the format knows no time zones."""
    if text is None:
        return ""
    return datetime.fromisoformat(text).strftime("%d.%m.%Y/%H:%M:%S")
