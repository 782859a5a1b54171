"""Sentences with figures in another language: which template one was made from is found by matching it.

So results need to say nothing twice, and those of a cached design or of an earlier job are translated too.
"""

import re
from collections.abc import Callable, Mapping
from functools import cached_property
from string import Formatter

#: One figure with a format, and the places that hold a position or an axis.
FIGURE, PLACE, PLACES = r"\N{MINUS SIGN}?[\d.]+(?: ?%)?", r"\([^()]*\)", frozenset({"place", "axis"})
#: A value that is figures and nothing else: `12.3`, `(1.20, −3.00, 0.00)`, `95.7 %`, `0.300 mm`.
FIGURES = re.compile(r"[+\N{MINUS SIGN}(]*\d[\d.,; +\N{MINUS SIGN}]*\)?( ?%| mm)?")


class Translation:
    """catalogue : template -> its translation, with the same places; local : a number by the language"""

    def __init__(self, catalogue: Mapping[str, str], local: Callable[[str], str]) -> None:
        self._catalogue, self._local = catalogue, local

    def __call__(self, text: str) -> str | None:
        """The translation of a sentence; None if no template fits."""
        if text in self._catalogue:
            return self._catalogue[text]
        for pattern, template in self._patterns:
            if found := pattern.fullmatch(text):
                translated = self._catalogue[template]
                return _filled(
                    translated, {name: self._value(each) for name, each in found.groupdict().items()}
                )
        return None

    @cached_property
    def _patterns(self) -> list[tuple[re.Pattern[str], str]]:
        """Of templates with places, those with the most words of their own first."""
        made = [(*_pattern(template), template) for template in self._catalogue if "{" in template]
        return [(pattern, template) for pattern, _, template in sorted(made, key=lambda each: -each[1])]

    def _value(self, text: str) -> str:
        """What stood at a place: figures, a word of the catalogue, or a name that stays as it is."""
        if FIGURES.fullmatch(text):
            return self._local(text.replace(", ", "; "))
        prefix, colon, last = text.rpartition(": ")
        if colon and last in self._catalogue:  # a kind of check after the name of its region
            return f"{prefix}: {self._catalogue[last]}"
        parts = [self(part) for part in text.split("; ")]
        return "; ".join(part for part in parts if part) if all(parts) else text


def _pattern(template: str) -> tuple[re.Pattern[str], int]:
    """The expression that fits what is made from the template, and how many characters are its own."""
    text, own, seen = "", 0, set[str]()
    for literal, name, spec, _ in Formatter().parse(template):
        text += re.escape(literal)
        own += len(literal)
        if name is not None:
            kind = FIGURE if spec else PLACE if name in PLACES else ".+"
            text += f"(?P={name})" if name in seen else f"(?P<{name}>{kind})"
            seen.add(name)
    return re.compile(text, re.DOTALL), own


def _filled(template: str, values: Mapping[str, str]) -> str:
    """As `format`, without the formats: the values are text by now."""
    return "".join(
        literal + ("" if name is None else values[name])
        for literal, name, _, _ in Formatter().parse(template)
    )
