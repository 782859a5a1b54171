"""Sentences with figures in them, for people: findings, reasons, decision rules.

Each is made of a template with named places, so that another language can say the same: the report finds the
template again by the text (`pipeline.report.translation`). Numbers are written in one style: `95.7 %`, a true
minus sign.
"""

from decimal import Decimal
from string import Formatter
from typing import Any

MINUS = "\N{MINUS SIGN}"


class _Figures(Formatter):
    def format_field(self, value: Any, format_spec: str) -> Any:
        if isinstance(value, str):
            return value
        text = str(super().format_field(value, format_spec))
        if "e" in text:
            text = format(Decimal(text), "f")  # 12300, not 1.23e+04
        return text.replace("-", MINUS).replace("%", " %")


_FIGURES = _Figures()


def sentence(template: str, /, **values: object) -> str:
    """`template` with its places filled: `sentence("{share:.1%} of it", share=0.5)` is `50.0 % of it`."""
    return _FIGURES.vformat(template, (), values)


def figure(value: float, digits: int = 3) -> str:
    """So many significant digits, without an exponent: `12300`, `−0.0123`."""
    return str(_FIGURES.format_field(float(value), f".{digits}g"))


def place(position_mm: Any, digits: int = 2) -> str:
    """`(1.20, −3.00, 0.00)`"""
    return "(" + ", ".join(sentence(f"{{axis:.{digits}f}}", axis=float(axis)) for axis in position_mm) + ")"
