"""Decides how the rows of a point text are written, from all of them; what is not certain is refused."""

import math
import re
from dataclasses import dataclass

import numpy as np

from pipeline.core.errors import ColumnsUnfit, UnreadableFile
from pipeline.core.mesh import FloatArray
from pipeline.core.point_columns import PointColumns
from pipeline.stages.load.point_text_columns import Evidence
from pipeline.stages.load.point_text_fields import WITHOUT_THOUSANDS, Shape
from pipeline.stages.load.point_text_head import Head
from pipeline.stages.load.point_text_heading import Heading, axes_first, heading_of, words_of
from pipeline.stages.load.point_text_lines import QUOTED_COMMA, REMEDY, BadRow, Rows, shown
from pipeline.stages.load.point_text_stated import stated_shapes

DELIMITERS = (";", "|", "\t", ",", " ")
#: Rows that the delimiter and the columns to read are chosen by; all rows are checked against the choice.
SAMPLE_ROWS = 200
#: A part of a sample that might be a coordinate, also with separators of thousands, which are named later.
_COORDINATE = re.compile(
    rb"[-+]?(?:\d[\d.,\x01']*(?: \d{3})*(?:[.,\x01]\d*)?|[.,\x01]\d+)(?:[eEdD][-+]?\d+)?(?<![,\x01])"
    rb"|[-+]?(?:nan|inf|infinity)|null|none|n/?a|--?|\?|",
    re.IGNORECASE,
)
_WHOLE = re.compile(rb"[-+]?\d+")


@dataclass(frozen=True, slots=True)
class Layout:
    """How to read a text: all that a person could state about it.

    delimiter : a character, or a space for any white space; decimal : "." or ","; columns : of x, y and z,
    from 0; n_columns : of each row; skipped : lines before the first row
    """

    delimiter: str
    decimal: str
    columns: tuple[int, int, int]
    n_columns: int
    skipped: int


def choose_shape(
    sample: list[bytes], head: Head, rows: Rows, stated: PointColumns | None = None
) -> tuple[Shape, Heading | None]:
    """The delimiter by which most rows of a sample have the columns of the first, and coordinates in them.

    stated : what a person says; its columns are those of the heading that is returned

    Raises
    ------
    UnreadableFile, ColumnsUnfit
        When no delimiter gives three coordinates, or two give different ones.
    """
    fits = []
    for delimiter in DELIMITERS:
        shapes = _shapes(sample, delimiter, head)
        for shape, heading in (
            shapes if stated is None else stated_shapes(sample[0], delimiter, shapes, stated)
        ):
            columns = heading.columns if heading else (0, 1, 2)
            table = [_split(line, shape) for line in sample]
            good = [
                len(fields) == shape.n_columns and all(_COORDINATE.fullmatch(fields[at]) for at in columns)
                for fields in table
            ]
            if good[0]:
                fits.append((sum(good), shape, heading, [table[0][at] for at in columns]))
    most = max((fit[0] for fit in fits), default=0)
    best = [fit for fit in fits if fit[0] == most]
    if not best and stated is not None:
        number, line = rows.place(0)
        raise ColumnsUnfit(f"line {number} has no numbers in the columns that options.columns states: {line}")
    if not best:
        raise _none_fits(sample, head, rows)
    _, shape, heading, first = best[0]
    for _, other, _, values in best[1:]:
        if values != first:
            remedy = None if stated is None else "state delimiter= or decimal= too, as in x,y,z decimal=comma"
            raise rows.unclear(0, _told(first, shape), _told(values, other), remedy)
    return shape, heading


def columns_to_read(sample: list[bytes], shape: Shape, heading: Heading | None) -> list[int]:
    """The columns that are needed to decide which are x, y and z, ascending."""
    if heading is not None:
        return sorted(heading.columns)
    table = [_split(line, shape) for line in sample]
    if shape.delimiter == "," and shape.n_columns > 3:
        n = min(shape.n_columns, 6)
        if all(_WHOLE.fullmatch(field) for fields in table for field in fields[:n] if field):
            return list(range(n))
    first_is_whole = shape.n_columns > 3 and all(_WHOLE.fullmatch(fields[0]) for fields in table if fields[0])
    return list(range(4 if first_is_whole else 3))


def layout_of(
    shape: Shape,
    heading: Heading | None,
    values: FloatArray,
    evidence: Evidence,
    sample: list[bytes],
    rows: Rows,
    skipped: int,
    stated: PointColumns | None = None,
) -> Layout:
    """The layout, from the numbers (n, k) of `columns_to_read` and how all of them look.

    Raises
    ------
    UnreadableFile
        When the text can be read in two ways, with both.
    """
    _check_decimals(shape, evidence, rows, None if stated is None else stated.decimal)
    decimal = "," if evidence.first_comma is not None or shape.pairs else "."
    columns = heading.columns if heading else _columns(shape, values, evidence, sample, rows)
    return Layout(shape.delimiter, decimal, columns, shape.n_columns, skipped)


def _check_decimals(shape: Shape, evidence: Evidence, rows: Rows, stated: str | None) -> None:
    """Raise where commas may separate thousands, or the decimal separator is not the one that was stated."""
    other = evidence.first_comma if stated == "." else evidence.first_point if stated == "," else None
    if other is not None:
        said = "point" if stated == "." else "comma"
        raise rows.refused(BadRow(other, f"does not have decimals as options.columns says (decimal={said})"))
    if evidence.first_comma is None:
        return
    if evidence.first_point is not None:
        raise rows.refused(
            BadRow(
                max(evidence.first_comma, evidence.first_point),
                "has a number with a comma or a point, and others have the other: one may separate thousands",
                remedy=WITHOUT_THOUSANDS,
            )
        )
    some_without = evidence.n_commas < evidence.n_numbers
    if (
        stated is None and evidence.three_digits and (some_without or shape.delimiter == ",")
    ):  # "1,234" in quotes is of Excel
        raise rows.unclear(
            evidence.first_comma,
            "with decimal commas (1,234 is 1.234)",
            "with separators of thousands (1,234 is 1234)",
            "state decimal=comma in options.columns, as in x,y,z decimal=comma, if commas are decimals; else "
            "export the text without separators of thousands",
        )


def _columns(
    shape: Shape, values: FloatArray, evidence: Evidence, sample: list[bytes], rows: Rows
) -> tuple[int, int, int]:
    """Columns of x, y and z without a heading."""
    whole = ~evidence.marked
    n = shape.n_columns
    unsigned = np.asarray((~np.signbit(values)).all(axis=0), dtype=np.bool_)
    if shape.delimiter == "," and n > 3 and whole.all() and unsigned[1:].any():
        words = [word.decode("ascii", "replace") for word in sample[0].split(b",")[:6]]
        pairs = list(zip(words[0::2], words[1::2], strict=False))
        decimals = "; ".join(f"{a},{b}" for a, b in pairs)
        raise rows.unclear(0, f"as x, y, z = {', '.join(words[:3])}", f"with decimal commas as {decimals}")
    _check_numbered_heading(sample, shape, whole, rows)
    if n == 3:
        return 0, 1, 2
    first, n_rows = values[:, 0], len(values)
    with np.errstate(invalid="ignore"):  # infinite minus infinite
        steps = np.diff(first)
    by_one = n_rows > 1 and bool((steps == 1).all()) and first[0] in (0.0, 1.0)
    as_xyz, as_id = "as x y z in columns 1 to 3", "as a number of the point and x y z in columns 2 to 4"
    if whole[0] and len(whole) >= 4:
        coordinates = bool((~whole[1:4]).all())
        if by_one and coordinates and n_rows >= 3:
            return 1, 2, 3
        distinct = len(np.unique(first)) == n_rows
        if coordinates or distinct:
            raise rows.unclear(0, as_xyz, as_id)
    elif (steps > 0).all() and not _has_known_others(sample, shape):
        raise rows.unclear(0, as_xyz, "as a time and x y z in columns 2 to 4")
    return 0, 1, 2


def _check_numbered_heading(sample: list[bytes], shape: Shape, whole: np.ndarray, rows: Rows) -> None:
    """Raise for a first row 0 1 2 over rows with decimals: pandas names columns so that have no names."""
    fields = [field for field in _split(sample[0], shape) if field]
    numbered = len(fields) >= 3 and fields == [str(at).encode() for at in range(len(fields))]
    if numbered and len(sample) > 1 and not whole[:3].any():
        raise rows.unclear(0, "as a point", "as numbers of the columns")


def _has_known_others(sample: list[bytes], shape: Shape) -> bool:
    """Whether six columns end with a colour or a normal, so that the first three are x, y and z."""
    if shape.n_columns not in (6, 9):
        return False
    table = [_split(line, shape)[3:6] for line in sample]
    if all(_WHOLE.fullmatch(field) and 0 <= int(field) <= 255 for fields in table for field in fields):
        return True
    try:
        lengths = [
            math.hypot(*(float(field.replace(b",", b".").replace(QUOTED_COMMA, b".")) for field in fields))
            for fields in table
        ]
    except ValueError:
        return False
    return all(abs(length - 1.0) < 0.02 for length in lengths)


def _shapes(sample: list[bytes], delimiter: str, head: Head) -> list[tuple[Shape, Heading | None]]:
    """The shapes that the first row has by a delimiter, with the heading of each."""
    if delimiter == " ":
        n, trailing = len(sample[0].split()), False
    else:
        mark = delimiter.encode()
        trailing = all(line.rstrip(b" \t" if delimiter != "\t" else b" ").endswith(mark) for line in sample)
        n = sample[0].count(mark) + 1 - trailing
    shapes: list[tuple[Shape, Heading | None]] = []
    for line, comment in head.headings:
        heading = heading_of(line, delimiter, n) if n >= 3 else None
        if heading is not None:
            return [(Shape(delimiter, n, trailing), heading)]
        if delimiter == "," and n % 2 == 0 and not trailing:
            heading = heading_of(line, delimiter, n // 2) if not comment else None
            if heading is not None:
                return [(Shape(delimiter, n // 2, pairs=True), heading)]
        if not comment:
            return []
    if n >= 3:
        shapes.append((Shape(delimiter, n, trailing), None))
    return shapes


def _split(line: bytes, shape: Shape) -> list[bytes]:
    if shape.delimiter == " ":
        return line.split()
    fields = [field.strip() for field in line.split(shape.delimiter.encode())]
    if shape.trailing:
        fields = fields[:-1]
    if shape.pairs:
        return [QUOTED_COMMA.join(pair) for pair in zip(fields[0::2], fields[1::2], strict=False)]
    return fields


def _told(values: list[bytes], shape: Shape) -> str:
    words = " ".join(value.decode("utf-8", "replace").replace("\x01", ",") for value in values)
    name = {" ": "spaces", "\t": "tabs"}.get(shape.delimiter, repr(shape.delimiter))
    return f"with columns by {name} as x y z = {words}"


def _none_fits(sample: list[bytes], head: Head, rows: Rows) -> UnreadableFile:
    number, line = rows.place(0)
    plain = [heading for heading, comment in head.headings if not comment]
    if plain:
        return UnreadableFile(
            f"the heading {shown(plain[0])} has {len(words_of(plain[0]))} words, which do not fit the "
            f"columns of line {number}: {line}",
            remedy="give each column a name, and name x, y and z",
        )
    return UnreadableFile(f"line {number} does not start with three numbers: {line}", remedy=REMEDY)


def check_comments(head: Head, heading: Heading | None, shape: Shape, rows: Rows) -> None:
    """Raise when a comment names x, y and z in another order or place, and does not fit the rows."""
    if heading is not None:
        return
    for line, _ in head.headings:
        words = words_of(line)
        said = None if axes_first(line) else heading_of(line, " ", len(words))
        if said is None or (shape.n_columns == 3 and list(said.columns) == sorted(said.columns)):
            continue
        raise rows.unclear(0, "as x y z in columns 1 to 3", f"as the comment {shown(line)} may say")
