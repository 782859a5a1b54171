"""The rows of an ASCII PLY: a line for each; where the lines are broken in another way, one row after another
as long as that uses up all numbers.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from pipeline.core.errors import PipelineError, UnreadableFile
from pipeline.core.mesh import BoolArray, FloatArray, IndexArray
from pipeline.core.results import Note
from pipeline.stages.load.number_text import NumberText, read_numbers, without_commas
from pipeline.stages.load.ply_columns import ListColumn, truncated
from pipeline.stages.load.ply_header import Element, Header, Property

#: The numbers are all there, but what their commas mean is decided here: Assimp, issue 750.
DECIMAL_COMMA = Note(
    code="decimal_comma",
    detail="the PLY has decimal commas (1,5); they are read as decimal points, nothing is lost",
)


@dataclass(frozen=True, slots=True, eq=False)
class AsciiRows:
    """values : all numbers of the file; starts : (n,) position of the first number of each row"""

    element: Element
    values: FloatArray
    starts: IndexArray

    def scalars(self, wanted: list[Property]) -> FloatArray:
        """(n, len(wanted)) values of scalar properties."""
        return np.stack([self.values[self._places(each)] for each in wanted], axis=1)

    def lists(self, wanted: Property) -> ListColumn:
        """Values of a list property."""
        at = self._places(wanted)
        counts = self.values[at].astype(np.int64)
        within = np.arange(int(counts.sum())) - np.repeat(np.cumsum(counts) - counts, counts)
        return ListColumn(self.values[np.repeat(at + 1, counts) + within], counts)

    def _places(self, wanted: Property) -> IndexArray:
        at = self.starts
        for each in self.element.properties:
            if each is wanted:
                break
            at = at + 1 if each.count is None else at + 1 + self.values[at].astype(np.int64)
        return at


def ascii_rows(data: bytes, header: Header) -> tuple[dict[str, AsciiRows], list[Note]]:
    """The rows of each element, by its name.

    Raises
    ------
    TruncatedFile, UnreadableFile
        With line, element and row.
    """
    text = data[header.size :]
    numbers = read_numbers(text, header.lines + 1)
    notes: list[Note] = []
    if numbers.stopped is not None and b"," in numbers.stopped:
        line = numbers.line_of(len(numbers.values))
        text, is_decimal = without_commas(text, text, "PLY", line)
        numbers = read_numbers(text, header.lines + 1)
        notes += [DECIMAL_COMMA] if is_decimal else []
    try:
        return _by_lines(numbers, header), notes
    except PipelineError:
        streamed = _by_numbers(numbers, header)
        if streamed is None:
            raise
        return streamed, notes


def _by_lines(numbers: NumberText, header: Header) -> dict[str, AsciiRows]:
    """A row a line."""
    line, found = 0, {}
    for element in header.elements:
        n = element.rows if element.properties else 0
        there = min(n, numbers.n_lines - line)
        lines = _Lines(numbers, element, line)
        starts, ends = numbers.first[line : line + there], numbers.first[line + 1 : line + there + 1]
        if numbers.stopped is not None and (there < n or ends[-1:].max(initial=0) > len(numbers.values)):
            number = numbers.line_of(len(numbers.values))
            raise UnreadableFile(f"line {number} of the PLY: {numbers.shown} is no number")
        at = starts
        if not element.has_lists:
            at = starts + len(element.properties)
            lines.refuse(at > ends, "short")
        else:
            for each in element.properties:
                lines.refuse(at >= ends, "short")
                if each.count is None:
                    at = at + 1
                    continue
                lengths = numbers.values[at]
                lines.refuse(~((lengths >= 0) & (lengths == np.floor(lengths)) & (lengths < 2**53)), "list")
                at = at + 1 + lengths.astype(np.int64)
            lines.refuse(at > ends, "short")
        lines.refuse(at < ends, "long")
        if there < n:
            raise truncated(element, there)
        found[element.name] = AsciiRows(element, numbers.values, starts)
        line += n
    return found


@dataclass(frozen=True, slots=True)
class _Lines:
    """first : line with words that the rows of the element start at"""

    numbers: NumberText
    element: Element
    first: int

    def refuse(self, wrong: BoolArray, fault: Literal["short", "long", "list"]) -> None:
        """Raise for the first row that is wrong, if there is one."""
        if not wrong.any():
            return
        row = int(wrong.argmax())
        line = self.first + row
        width = int(self.numbers.first[line + 1] - self.numbers.first[line])
        place = f"line {self.numbers.lines[line]}"
        if fault == "short" and line == self.numbers.n_lines - 1:
            raise truncated(self.element, row, f"{place}, the last one, ends after {width} values")
        what = {
            "short": f"has {width} values, which is too few for",
            "long": f"has {width} values, which is too many for",
            "list": "has a list whose length is no number of items:",
        }[fault]
        raise UnreadableFile(
            f"{place} of the PLY, row {row} of {self.element.name} (the first is 0), {what} "
            f"the properties in the header ({self.element.listed})"
        )


def _by_numbers(numbers: NumberText, header: Header) -> dict[str, AsciiRows] | None:
    """Rows wherever lines end; None if the numbers are not exactly those of the header."""
    at, found, values = 0, {}, numbers.values
    if numbers.stopped is not None:
        return None
    for element in header.elements:
        n, k = element.rows, len(element.properties)
        if at + n * k > len(values):
            return None
        if not element.has_lists:
            found[element.name] = AsciiRows(element, values, at + k * np.arange(n if k else 0))
            at += n * k
            continue
        starts = np.zeros(n, dtype=np.int64)
        for row in range(n):
            starts[row] = at
            for each in element.properties:
                length = 0.0 if at >= len(values) or each.count is None else float(values[at])
                if not (0 <= length <= len(values)) or length != int(length):
                    return None
                at += 1 + int(length)
        found[element.name] = AsciiRows(element, values, starts)
    return found if at == len(values) else None
