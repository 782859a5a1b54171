"""Words and numbers of the text formats OBJ and OFF, whole blocks of lines at once.

Positions are bytes; words are runs of bytes that are not white space. A block of 8 MB takes about 0.3 s.
"""

import re
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pipeline.core.errors import UnreadableFile
from pipeline.core.formats import as_utf8
from pipeline.core.mesh import BoolArray, FloatArray, IndexArray

#: Bytes of a block; affects only memory.
BLOCK = 8 << 20
#: Digits of an index that is read; 64 bits hold one more.
MAX_DIGITS = 18
#: Characters of a word in a message.
SHOWN = 40
_SOLID = np.ones(256, dtype=np.bool_)
_SOLID[list(b" \t\n\v\f\r")] = False
_NUMBER = re.compile(
    rb"[-+]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][-+]?\d+)?|[-+]?(?:nan|inf|infinity)", re.IGNORECASE
)
_COMMA_NUMBER = re.compile(rb"[-+]?\d+(?:,\d+)?(?:[eE][-+]?\d+)?")
_COMMA_REMEDY = "export it with a decimal point and with spaces between the numbers"


@dataclass(frozen=True, slots=True, eq=False)
class Words:
    """text : (b,) uint8; starts, ends : (w,) of each word; lines : (n,) position of each line; first :
    (n + 1,) first word of each line: those of line i are `first[i]` up to `first[i + 1]`; line_number : of
    the first line in the file, from 1
    """

    text: npt.NDArray[np.uint8]
    starts: IndexArray
    ends: IndexArray
    lines: IndexArray
    first: IndexArray
    line_number: int

    @property
    def counts(self) -> IndexArray:
        """(n,) words of each line."""
        return np.diff(self.first)

    def word(self, index: int) -> bytes:
        return self.text[self.starts[index] : self.ends[index]].tobytes()

    def of_line(self, line: int) -> list[bytes]:
        return [self.word(index) for index in range(self.first[line], self.first[line + 1])]

    def place(self, line: int) -> int:
        """Number of a line in the file, from 1."""
        return self.line_number + int(line)


def plain_lines(data: bytes) -> bytes:
    """The text without byte order mark, its lines ended by a line feed."""
    data = as_utf8(data)
    return data.replace(b"\r\n", b"\n").replace(b"\r", b"\n") if b"\r" in data else data


def blocks(data: bytes, start: int = 0, line_number: int = 1) -> Iterator[tuple[bytes, int]]:
    """Whole lines, about `BLOCK` bytes each time, and the number of the first."""
    while start < len(data):
        end = len(data)
        if start + BLOCK < end:
            end = (data.find(b"\n", start + BLOCK) + 1) or end
        block = data[start:end]
        yield block, line_number
        line_number += block.count(b"\n")
        start = end


def words_of(block: bytes, line_number: int = 1) -> Words:
    """The words of a text, by line."""
    text = np.frombuffer(block, dtype=np.uint8)
    solid = np.concatenate([[False], _SOLID[text], [False]])
    edges = np.flatnonzero(solid[1:] != solid[:-1])
    lines = np.concatenate([[0], np.flatnonzero(text == ord("\n")) + 1])
    lines = lines[lines < len(text)]
    starts = np.ascontiguousarray(edges[::2])
    first = np.append(np.searchsorted(starts, lines), len(starts))
    return Words(text, starts, np.ascontiguousarray(edges[1::2]), lines, first, line_number)


def integers(words: Words, index: IndexArray, stop_at: str = "") -> tuple[IndexArray, BoolArray]:
    """(w,) values of the words `index`, each up to the first `stop_at`, and whether it is a whole number."""
    starts, ends = words.starts[index], words.ends[index]
    if stop_at:
        stops = np.append(np.flatnonzero(words.text == ord(stop_at)), len(words.text))
        ends = np.minimum(ends, stops[np.searchsorted(stops, starts)])
    values = np.zeros(len(starts), dtype=np.int64)
    if not len(starts):
        return values, np.ones(0, dtype=np.bool_)
    lead = words.text[starts]
    negative = lead == ord("-")
    begin = starts + (negative | (lead == ord("+")))
    digits = ends - begin
    good = (digits > 0) & (digits <= MAX_DIGITS)
    for place in range(int(digits[good].max(initial=0))):
        digit = words.text[np.maximum(ends - 1 - place, starts)] - np.uint8(ord("0"))
        within = digits > place
        good &= ~within | (digit <= 9)
        values += np.where(within, digit, 0) * np.int64(10**place)
    return np.where(negative, -values, values), good


def numbers(words: Words, lines: IndexArray, width: int, kind: str, *, skip: int = 0) -> FloatArray:
    """(n, width) the first numbers of the lines, after `skip` words of one letter.

    Raises
    ------
    UnreadableFile
        For a line with fewer words, or with a word that is no number.
    """
    counts = words.counts[lines] - skip
    short = np.flatnonzero(counts < width)
    if short.size:
        line = lines[short[0]]
        raise UnreadableFile(
            f"line {words.place(line)} of the {kind} has {counts[short[0]]} coordinates, not {width}"
        )
    if not len(lines):
        return np.zeros((0, width))
    text = _text_of(words, lines, skip)
    try:
        # Separators may be absent (`1.5.2` gives two numbers), thus the count.
        values = np.fromstring(text.decode("ascii"), dtype=np.float64, sep=" ")
    except (ValueError, DeprecationWarning):
        values = np.zeros(0)
    if values.size != counts.sum():
        return _numbers_word_by_word(words, lines, width, kind, skip)
    if (counts == counts[0]).all():
        return np.ascontiguousarray(values.reshape(len(lines), -1)[:, :width])
    return np.asarray(values[(np.cumsum(counts) - counts)[:, None] + np.arange(width)])


def _text_of(words: Words, lines: IndexArray, skip: int) -> bytes:
    """The text of the lines, without the first letter where `skip`."""
    ends = np.append(words.lines[1:], len(words.text))
    if lines[-1] - lines[0] == len(lines) - 1:
        begin, end = words.lines[lines[0]], ends[lines[-1]]
        text = words.text[begin:end].copy()
        if skip:
            text[words.starts[words.first[lines]] - begin] = ord(" ")
        return text.tobytes()
    text = words.text.copy()
    if skip:
        text[words.starts[words.first[lines]]] = ord(" ")
    chosen = np.zeros(len(words.lines), dtype=np.bool_)
    chosen[lines] = True
    within = np.repeat(chosen, ends - words.lines)
    return text[within].tobytes()


def _numbers_word_by_word(words: Words, lines: IndexArray, width: int, kind: str, skip: int) -> FloatArray:
    rows = []
    for line in lines:
        row = words.of_line(line)[skip : skip + width]
        for word in row:
            if not _NUMBER.fullmatch(word):
                comma = b"," in word
                raise UnreadableFile(
                    f"line {words.place(line)} of the {kind} has {shown(word)} where a number should be",
                    remedy=_COMMA_REMEDY if comma else None,
                )
        rows.append([float(word) for word in row])
    return np.array(rows, dtype=np.float64).reshape(-1, width)


def shown(word: bytes) -> str:
    """A word of the file for a message, in quotes."""
    text = word[:SHOWN].decode("utf-8", errors="replace") + ("…" if len(word) > SHOWN else "")
    return "'" + "".join(letter if letter.isprintable() else "\ufffd" for letter in text) + "'"


def is_decimal_comma(numbers_of_line: list[bytes]) -> bool:
    """Whether a comma in these words can only be a decimal one: three words at least, none with a point."""
    return len(numbers_of_line) >= 3 and all(map(_COMMA_NUMBER.fullmatch, numbers_of_line))


def ambiguous_comma(kind: str, line: int) -> UnreadableFile:
    """A comma that may separate numbers, decimals or thousands."""
    return UnreadableFile(
        f"line {line} of the {kind} has commas in its numbers, and it is not clear what they separate",
        remedy=_COMMA_REMEDY,
    )
