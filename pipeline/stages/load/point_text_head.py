"""What stands before the first row of a point text."""

import re
from dataclasses import dataclass

from pipeline.core.errors import UnreadableFile
from pipeline.core.formats import is_number_row, names_axes
from pipeline.stages.load.point_text_lines import MAX_LINE_BYTES, TOO_LONG, shown

#: Lines before the first row that are looked through.
MAX_HEAD_LINES = 10_000
#: Most blocks of a .pts and scans of a .ptx.
MAX_SECTIONS = 1000
#: Longest heading.
MAX_HEADING_BYTES = 4096
_COMMENT = (b"#", b"//", b"%", b"!", b";")


@dataclass(frozen=True, slots=True)
class Head:
    """begin : where the first row starts, in bytes; first_line : its number, from 1; headings : lines that
    name x, y and z, the last first, each with whether it is a comment; others : lines of text that do not
    """

    begin: int
    first_line: int
    headings: tuple[tuple[bytes, bool], ...]
    others: tuple[bytes, ...]


def head_of(text: bytes) -> Head:
    """Find the first row: a line of numbers, or any line after a heading.

    Raises
    ------
    UnreadableFile
        When there is none.
    """
    headings: list[tuple[bytes, bool]] = []
    others: list[bytes] = []
    at, number, named = 0, 1, False
    while at < len(text):
        end = text.find(b"\n", at)
        end = len(text) if end < 0 else end
        line = text[at : min(end, at + MAX_LINE_BYTES + 1)].strip()
        if len(line) > MAX_LINE_BYTES:
            raise UnreadableFile(f"line {number} {TOO_LONG}: {shown(line[:99])}")
        if line.startswith(_COMMENT) and not (line.startswith(b";") and b";" in line[1:]):
            if names_axes(line[:MAX_HEADING_BYTES]):
                headings.append((line[:MAX_HEADING_BYTES], True))
        elif line:
            if is_number_row(line):
                return Head(at, number, tuple(reversed(headings)), tuple(others))
            if len(line) < MAX_HEADING_BYTES and names_axes(line):
                headings.append((line, False))
                named = True
            elif named or headings:
                return Head(at, number, tuple(reversed(headings)), tuple(others))
            else:
                others.append(line)
        if number == MAX_HEAD_LINES:
            raise UnreadableFile(
                f"the first {number} lines have no row of numbers and no heading that names x, y and z",
                remedy="write one point on each line: x y z, and remove the text before",
            )
        at, number = end + 1, number + 1
    if others:
        raise UnreadableFile(
            f"the text has no row of numbers and no heading that names x, y and z; it starts with "
            f"{shown(others[0])}",
            remedy="write one point on each line: x y z, below a heading that names x, y and z",
        )
    raise UnreadableFile("the text has no points", remedy="write one point on each line: x y z")


def count_of(line: bytes) -> int | None:
    """The number of a line that has nothing but one whole number."""
    word = line.strip()
    return int(word) if re.fullmatch(rb"\d{1,15}", word) else None
