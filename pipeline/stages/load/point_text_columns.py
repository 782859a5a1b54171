"""The numbers of some columns of a text, whose rows are checked to have all the same columns."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from pipeline.core.mesh import BoolArray, FloatArray
from pipeline.stages.load.number_text import BLOCK_BYTES
from pipeline.stages.load.point_text_fields import Fields, Shape, split_fields, split_words
from pipeline.stages.load.point_text_lines import MAX_LINE_BYTES, QUOTED_COMMA, TOO_LONG, BadRow

#: Decimal points and exponents.
_MARKS = np.frombuffer(b".eEdD", dtype=np.uint8)


@dataclass(slots=True, eq=False)
class Evidence:
    """What the numbers look like, over all rows: enough to know what their marks mean.

    marked : (k,) columns with a decimal mark or an exponent in some row; n_numbers, n_commas : numbers, and
    those with a decimal comma; first_comma, first_point : the first row with one, or None; three_digits :
    three digits follow each comma, and no number starts with 0,
    """

    marked: BoolArray
    n_numbers: int = 0
    n_commas: int = 0
    first_comma: int | None = None
    first_point: int | None = None
    three_digits: bool = True


@dataclass(slots=True, eq=False)
class ColumnReader:
    """Reads the columns `wanted`, in ascending order; `read` may be called for several parts of a text."""

    shape: Shape
    wanted: Sequence[int]
    evidence: Evidence = field(init=False)

    def __post_init__(self) -> None:
        self.evidence = Evidence(np.zeros(len(self.wanted), dtype=np.bool_))

    def read(self, rows: bytes, first_row: int) -> FloatArray:
        """(n, k) numbers, NaN where there is none; `first_row` counts the rows before.

        Memory is some times a block of text, beside the numbers.

        Raises
        ------
        BadRow
            Where a row has more or fewer columns than the shape, or no number in a column.
        """
        parts = [np.zeros((0, len(self.wanted)))]
        for block in _blocks(rows):
            if len(block) > BLOCK_BYTES + MAX_LINE_BYTES:
                raise BadRow(first_row + block.count(b"\n") - 1, TOO_LONG)
            try:
                parts.append(self._read_block(block, first_row))
            except BadRow as bad:
                raise BadRow(first_row + bad.row, bad.reason, fewer=bad.fewer, remedy=bad.remedy) from None
            first_row += len(parts[-1])
        return np.concatenate(parts)

    def _read_block(self, block: bytes, first_row: int) -> FloatArray:
        raw = np.frombuffer(block, dtype=np.uint8)
        split = split_words if self.shape.delimiter == " " else split_fields
        begins, ends = split(raw, np.flatnonzero(raw == 10), self.shape)
        if self.shape.pairs:
            raw = raw.copy()
            raw[ends[:, 0::2]] = QUOTED_COMMA[0]
            begins, ends = begins[:, 0::2], ends[:, 1::2]
        if begins.shape[1] == len(self.wanted) and self.shape.delimiter == " ":
            fields = Fields(raw, block, (ends + 1).ravel(), " ")
        else:
            fields = Fields.of(raw, begins[:, self.wanted], ends[:, self.wanted], self.shape.delimiter)
        self._note_marks(fields, first_row)
        try:
            return fields.numbers().reshape(-1, len(self.wanted))
        except BadRow as bad:
            raise BadRow(bad.row // len(self.wanted), bad.reason, remedy=bad.remedy) from None

    def _note_marks(self, fields: Fields, first_row: int) -> None:
        k, seen = len(self.wanted), self.evidence
        comma = fields.text.find(QUOTED_COMMA)
        if comma < 0 and self.shape.delimiter != ",":
            comma = fields.text.find(b",")
        seen.n_numbers += len(fields.bounds)
        if seen.first_point is None and b"." in fields.text:
            seen.first_point = first_row + fields.place(fields.text.index(b".")) // k
        if comma >= 0:
            if seen.first_comma is None:
                seen.first_comma = first_row + fields.place(comma) // k
            if seen.three_digits:
                commas = fields.commas
                seen.n_commas += int(commas.sum())
                seen.three_digits = fields.three_digits_follow(commas)
        if not seen.marked.all():
            marks = fields.commas | np.isin(fields.kept, _MARKS)
            seen.marked[np.unique(fields.places(marks) % k)] = True


def _blocks(rows: bytes) -> Iterator[bytes]:
    at = 0
    while at < len(rows):
        end = rows.find(b"\n", at + BLOCK_BYTES)
        end = len(rows) if end < 0 else end + 1
        yield rows[at:end]
        at = end
