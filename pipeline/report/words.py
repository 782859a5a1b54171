"""The words and numbers of the report in its language: English, or what `german.py` has for it.

As with gettext, the English text is the key. A key without a translation stays English.
"""

from dataclasses import dataclass
from datetime import datetime
from functools import cache
from typing import Literal

from pipeline.report import numbers
from pipeline.report.german import GERMAN
from pipeline.report.german_findings import GERMAN_FINDINGS
from pipeline.report.german_notes import GERMAN_NOTES
from pipeline.report.german_studies import GERMAN_STUDIES
from pipeline.report.translation import Translation

Language = Literal["en", "de"]
CATALOGUES: dict[Language, dict[str, str]] = {"en": {}, "de": GERMAN | GERMAN_FINDINGS | GERMAN_STUDIES}
NOTES: dict[Language, dict[str, str]] = {"en": {}, "de": GERMAN_NOTES}
DATES: dict[Language, str] = {"en": "%Y-%m-%d %H:%M UTC", "de": "%d.%m.%Y %H:%M UTC"}


@dataclass(frozen=True, slots=True)
class Words:
    """language : of the report"""

    language: Language = "en"

    def __call__(self, text: str, **values: object) -> str:
        """`text` in the language, with `{name}` replaced by the values."""
        said = CATALOGUES[self.language].get(text, text)
        return said.format(**values) if values else said

    def sentence(self, text: str) -> str:
        """A sentence with figures, of `pipeline.core.sentences`; a text of another origin stays as it is."""
        return text if self.language == "en" else translation(self.language)(text) or text

    def note(self, code: str, detail: str) -> str:
        """A warning: what it means, and the detail, whose figures and names are of the file."""
        meaning = NOTES[self.language].get(code)
        return detail if meaning is None else f"{meaning}. [{detail}]"

    def local(self, number: str) -> str:
        """A number as `numbers.py` writes it, with the decimal mark of the language."""
        return number.replace(".", ",") if self.language == "de" else number

    def fixed(self, value: float, digits: int = 3) -> str:
        return self.local(numbers.fixed(value, digits))

    def signed(self, value: float, digits: int = 3) -> str:
        return self.local(numbers.signed(value, digits))

    def millimetres(self, value: float | None, digits: int = 3) -> str:
        return self.local(numbers.millimetres(value, digits))

    def percent(self, share: float | None, digits: int = 1) -> str:
        return self.local(numbers.percent(share, digits))

    def count(self, number: int) -> str:
        """With a mark after each three digits: `10,000`."""
        return f"{number:,}".replace(",", "." if self.language == "de" else ",")

    def short(self, value: float, digits: int = 3) -> str:
        """So many significant digits: `0.15`, `27.7`."""
        return self.local(f"{value:.{digits}g}".replace("-", numbers.MINUS))

    def point(self, position_mm: list[float], digits: int = 2) -> str:
        """`1.20, −3.00, 0.00`; with semicolons where the comma is the decimal mark"""
        between = "; " if self.language == "de" else ", "
        return between.join(self.fixed(axis, digits) for axis in position_mm)

    def date(self, iso: str) -> str:
        """A time of ISO 8601 in UTC."""
        return datetime.fromisoformat(iso).strftime(DATES[self.language])


@cache
def translation(language: Language) -> Translation:
    """Of sentences with figures."""
    return Translation(CATALOGUES[language], Words(language).local)


ENGLISH = Words("en")
