"""The fields of the rows of a block of text, and the number in each."""

import re
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pipeline.core.mesh import BoolArray, FloatArray, IndexArray
from pipeline.stages.load.number_text import parsed
from pipeline.stages.load.point_text_lines import QUOTED_COMMA, BadRow, shown

Bytes = npt.NDArray[np.uint8]

_IS_DIGIT = np.isin(np.arange(256), list(b"0123456789"))
_NOTHING = re.compile(rb"(?<!\S)(?:null|none|n/?a|--?|\?)(?!\S)", re.IGNORECASE)
_THOUSANDS = re.compile(
    rb"[-+]?\d{1,3}(?:(?:,\d{3})+\.\d*|(?:\.\d{3})+,\d*|(?:,\d{3}){2,}|(?:\.\d{3}){2,}"
    rb"|(?:[' ]\d{3})+(?:[.,]\d*)?)"
)
WITHOUT_THOUSANDS = "export the text without separators of thousands, and with a point as decimal separator"


@dataclass(frozen=True, slots=True)
class Shape:
    """What the rows of a text have in common.

    delimiter : a character, or a space for any white space; n_columns; trailing : a delimiter ends each row;
    pairs : commas separate columns and decimals, so two fields make a number
    """

    delimiter: str
    n_columns: int
    trailing: bool = False
    pairs: bool = False

    @property
    def n_fields(self) -> int:
        """Fields between delimiters."""
        return self.n_columns * (2 if self.pairs else 1)


@dataclass(frozen=True, slots=True, eq=False)
class Fields:
    """kept, text : the bytes of the fields that are read, each with a separator after it; bounds : (f,) end
    of each with its separator
    """

    kept: Bytes
    text: bytes
    bounds: IndexArray
    delimiter: str

    @classmethod
    def of(cls, raw: Bytes, begins: IndexArray, ends: IndexArray, delimiter: str) -> "Fields":
        """The fields (n, k) that begin and end at these bytes."""
        step = np.zeros(len(raw) + 1, dtype=np.int8)
        for column in range(begins.shape[1]):
            step[begins[:, column]] += 1
            step[ends[:, column] + 1] -= 1
        kept = raw[np.cumsum(step[:-1], dtype=np.int8).view(np.bool_)]
        return cls(kept, kept.tobytes(), np.cumsum((ends - begins + 1).ravel()), delimiter)

    @property
    def commas(self) -> BoolArray:
        """Of each byte, whether it is a decimal comma."""
        within: BoolArray = self.kept == QUOTED_COMMA[0]
        return within if self.delimiter == "," else within | (self.kept == ord(","))

    def places(self, marks: BoolArray) -> IndexArray:
        """The field of each byte that is marked, ascending."""
        return np.searchsorted(self.bounds, np.flatnonzero(marks), side="right")

    def place(self, at: int) -> int:
        """The field of a byte."""
        return int(np.searchsorted(self.bounds, at, side="right"))

    def three_digits_follow(self, commas: BoolArray) -> bool:
        """Whether three digits follow each decimal comma, and none stands after a leading zero."""
        digit = np.concatenate([_IS_DIGIT[self.kept], np.zeros(4, dtype=np.bool_)])
        at = np.flatnonzero(commas)
        three = digit[at + 1] & digit[at + 2] & digit[at + 3] & ~digit[at + 4]
        zero = (self.kept[at - 1] == ord("0")) & ~digit[at - 2]
        return bool((three & ~zero & digit[at - 1]).all())

    def numbers(self) -> FloatArray:
        """(f,) numbers.

        Raises
        ------
        BadRow
            With the field in place of the row.
        """
        comma = b" " if self.delimiter == "," else b"."
        plain = self.text.translate(bytes.maketrans(b"Dd\n," + QUOTED_COMMA, b"Ee " + comma + b"."))
        if self.delimiter not in (" ", ","):
            plain = plain.replace(self.delimiter.encode(), b" ")
        if self.delimiter != " ":
            plain = self._without_gaps(plain)
        numbers, stopped = parsed(plain, len(self.bounds))
        if stopped is not None:
            plain = _NOTHING.sub(b"nan", plain)
            numbers, stopped = parsed(plain, len(self.bounds))
        if stopped is not None or len(numbers) != len(self.bounds):
            raise self._no_number(min(len(numbers), len(self.bounds) - 1))
        return numbers

    def _without_gaps(self, plain: bytes) -> bytes:
        """With nan for each empty field."""
        spaces = self.kept == ord(" ")
        if self.delimiter != "\t":
            spaces |= self.kept == ord("\t")
        lengths = np.diff(self.bounds, prepend=0)
        if not spaces.any() and lengths.min() > 1:
            return plain
        space = _is_space(np.frombuffer(plain, dtype=np.uint8))
        begins = ~space
        begins[1:] &= space[:-1]
        words = np.bincount(self.places(begins), minlength=len(self.bounds))
        if words.max() > 1:
            raise self._no_number(int(words.argmax()))
        if words.min() == 1:
            return plain
        starts = self.bounds - lengths
        return b" ".join(
            plain[start:end].strip() or b"nan"
            for start, end in zip(starts.tolist(), self.bounds.tolist(), strict=True)
        )

    def _no_number(self, field_: int) -> BadRow:
        end = int(self.bounds[field_])
        start = int(self.bounds[field_ - 1]) if field_ else 0
        word = self.text[start : end - 1].replace(QUOTED_COMMA, b",").strip()
        if _THOUSANDS.fullmatch(word):
            return BadRow(
                field_,
                f"has separators of thousands in the number {shown(word)}",
                remedy=WITHOUT_THOUSANDS,
            )
        return BadRow(field_, f"has {shown(word)} in place of a number")


def split_fields(raw: Bytes, ends_of_rows: IndexArray, shape: Shape) -> tuple[IndexArray, IndexArray]:
    """(n, f) begin and end of each field, by delimiters."""
    at = np.flatnonzero(raw == ord(shape.delimiter))
    n, per_row = len(ends_of_rows), shape.n_fields - 1 + shape.trailing
    counts = np.diff(np.searchsorted(at, ends_of_rows), prepend=0)
    if (counts != per_row).any():
        row = int((counts != per_row).argmax())
        raise _other_number(row, int(counts[row]) + 1 - shape.trailing, shape)
    by_row = at.reshape(n, per_row)
    starts_of_rows = np.concatenate([[0], ends_of_rows[:-1] + 1])
    begins = np.concatenate([starts_of_rows[:, None], by_row + 1], axis=1)
    ends = np.concatenate([by_row, ends_of_rows[:, None]], axis=1)
    if shape.trailing and (begins[:, -1] != ends[:, -1]).any():
        for row in np.flatnonzero(begins[:, -1] != ends[:, -1]).tolist():
            if raw[begins[row, -1] : ends[row, -1]].tobytes().strip():
                raise _other_number(row, shape.n_columns + 1, shape)
    return begins[:, : shape.n_fields], ends[:, : shape.n_fields]


def split_words(raw: Bytes, ends_of_rows: IndexArray, shape: Shape) -> tuple[IndexArray, IndexArray]:
    """(n, f) begin and end of each word."""
    space = _is_space(raw)
    starts = ~space
    starts[1:] &= space[:-1]
    begins, ends = np.flatnonzero(starts), np.flatnonzero(space[1:] & ~space[:-1]) + 1
    n, per_row = len(ends_of_rows), shape.n_fields
    whole = len(begins) == n * per_row
    if whole and n:
        table = begins.reshape(n, per_row)
        whole = bool((table[:, -1] < ends_of_rows).all() and (table[1:, 0] > ends_of_rows[:-1]).all())
    if not whole:
        counts = np.diff(np.searchsorted(begins, ends_of_rows), prepend=0)
        row = int((counts != per_row).argmax())
        raise _other_number(row, int(counts[row]), shape)
    return begins.reshape(n, per_row), ends.reshape(n, per_row)


def _other_number(row: int, n_columns: int, shape: Shape) -> BadRow:
    return BadRow(
        row,
        f"has {n_columns} column{'' if n_columns == 1 else 's'}, the first row has {shape.n_columns}",
        fewer=n_columns < shape.n_columns,
    )


def _is_space(raw: Bytes) -> BoolArray:
    """Blank, tab and line end; also control characters, which are in no number and are refused there."""
    return np.asarray((raw <= ord(" ")) & (raw != QUOTED_COMMA[0]), dtype=np.bool_)
