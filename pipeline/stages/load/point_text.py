"""Points as text (.xyz .txt .asc .csv .pts .ptx): a line for each.

Delimiter, decimal separator and columns are decided from the heading and from all rows together (`Layout`).
A text with two meanings is refused with both: coordinates read wrongly would be a wrong result.
"""

import itertools
import re
from dataclasses import dataclass

import numpy as np

from pipeline.core.errors import ColumnsUnfit, MeshTooLarge, NotFinite, TruncatedFile, UnreadableFile
from pipeline.core.mesh import FloatArray
from pipeline.core.point_columns import PointColumns
from pipeline.core.results import Note
from pipeline.core.settings import LoadSettings
from pipeline.stages.load.contents import Body, Contents
from pipeline.stages.load.point_text_columns import ColumnReader
from pipeline.stages.load.point_text_fields import Shape
from pipeline.stages.load.point_text_head import MAX_SECTIONS, Head, count_of, head_of
from pipeline.stages.load.point_text_heading import Heading, words_of
from pipeline.stages.load.point_text_layout import (
    SAMPLE_ROWS,
    Layout,
    check_comments,
    choose_shape,
    columns_to_read,
    layout_of,
)
from pipeline.stages.load.point_text_lines import (
    MAX_LINE_BYTES,
    TOO_LONG,
    BadRow,
    Rows,
    decoded,
    rows_of,
    shown,
)
from pipeline.stages.load.point_text_ptx import is_ptx, read_ptx

#: Rows without a position are left out while that many points remain; less span no surface.
MIN_POINTS = 3
_COUNT_LINE = re.compile(rb"^[ \t]*(\d{1,15})[ \t]*\n", re.MULTILINE)


@dataclass(frozen=True, slots=True)
class Section:
    """Rows from byte `begin` to `end` of the rows of a text; first_row : number of rows before; announced :
    by the line before, or None
    """

    begin: int
    end: int
    first_row: int
    announced: int | None


def read_point_text(data: bytes, settings: LoadSettings, columns: str | None = None) -> Contents:
    """The points of a text, one a line; a body for each block that a .pts counts, or scan of a .ptx.

    The unit is that of the heading, x[mm], where all of x, y and z have it. Rows without a position are left
    out and counted in a note. columns : as a person states them (`core.point_columns`), None where the text
    says it

    Raises
    ------
    TruncatedFile, UnreadableFile, MeshTooLarge, NotFinite, ColumnsUnfit
        With the line; UnreadableFile with both readings where there are two.
    """
    stated = _stated(columns)
    text = decoded(data)
    head = head_of(text)
    rows = rows_of(text[head.begin :], head.first_line)
    if is_ptx(rows):
        if stated is not None:
            raise ColumnsUnfit("the text is a PTX, which has columns of its own")
        return read_ptx(rows, settings)
    sections = _sections(rows)
    n_rows = rows.text.count(b"\n") - sum(section.announced is not None for section in sections)
    if n_rows > settings.max_points:
        raise MeshTooLarge(f"{n_rows} points; the limit is {settings.max_points}")
    _check_counts(rows, sections)
    clouds, layout, heading = _read(rows, sections, head, stated)
    notes = [*_notes_of(layout, heading, head), *_notes_of_counts(rows, sections)]
    bodies, without_position = _with_positions(clouds)
    return Contents(bodies, heading.unit if heading else None, (*notes, *without_position))


def _stated(columns: str | None) -> PointColumns | None:
    if columns is None:
        return None
    try:
        return PointColumns.of(columns)
    except ValueError as error:
        raise ColumnsUnfit(f"options.columns {columns[:100]!r}: {error}", remedy="") from None


def _sections(rows: Rows) -> list[Section]:
    """The rows between lines that count them; one section where the first line is a row."""
    if count_of(rows.text[: rows.text.find(b"\n") + 1]) is None:
        return [Section(0, len(rows.text), 0, None)]
    lines = list(itertools.islice(_COUNT_LINE.finditer(rows.text), MAX_SECTIONS + 1))
    if len(lines) > MAX_SECTIONS:
        raise MeshTooLarge(f"more than {MAX_SECTIONS} lines that count points", remedy="split the file")
    sections, row = [], 0
    for at, line in enumerate(lines):
        end = lines[at + 1].start() if at + 1 < len(lines) else len(rows.text)
        sections.append(Section(line.end(), end, row + 1, int(line[1])))
        row += 1 + rows.text.count(b"\n", line.end(), end)
    return sections


def _check_counts(rows: Rows, sections: list[Section]) -> None:
    for section in sections:
        there = rows.text.count(b"\n", section.begin, section.end)
        if section.announced is not None and there < section.announced:
            number, _ = rows.place(section.first_row - 1)
            raise TruncatedFile(
                f"line {number} announces {section.announced} points, and {there} follow"
                + (" before the next count" if section.end < len(rows.text) else "")
            )


def _notes_of_counts(rows: Rows, sections: list[Section]) -> list[Note]:
    notes = []
    for section in sections:
        there = rows.text.count(b"\n", section.begin, section.end)
        if section.announced is not None and there > section.announced:
            number, _ = rows.place(section.first_row - 1)
            detail = (
                f"the text: line {number} announces {section.announced} points, and {there} follow; "
                f"all {there} are read"
            )
            notes.append(Note(code="more_points_than_announced", detail=detail))
    return notes


def _read(
    rows: Rows, sections: list[Section], head: Head, stated: PointColumns | None
) -> tuple[list[FloatArray], Layout, Heading | None]:
    """The points (n, 3) of each section, in the layout that all of them have."""
    sample: list[bytes] = []
    for section in sections:
        if len(sample) < SAMPLE_ROWS:
            try:
                sample += _first_lines(rows.text, section, SAMPLE_ROWS - len(sample))
            except BadRow as bad:
                raise rows.refused(bad) from None
    if not sample:
        raise UnreadableFile("the text has no points", remedy="write one point on each line: x y z")
    shape, heading = choose_shape(sample, head, rows, stated)
    check_comments(head, heading, shape, rows)
    _check_others(head, heading, shape)
    wanted = columns_to_read(sample, shape, heading)
    reader = ColumnReader(shape, wanted)
    try:
        tables = [reader.read(rows.text[each.begin : each.end], each.first_row) for each in sections]
        _check_last(rows, sample)
    except BadRow as bad:
        raise rows.refused(bad) from None
    values = tables[0] if len(tables) == 1 else np.concatenate(tables)
    layout = layout_of(shape, heading, values, reader.evidence, sample, rows, head.first_line - 1, stated)
    places = [wanted.index(column) for column in layout.columns]
    return [table[:, places] for table in tables], layout, heading


def _first_lines(text: bytes, section: Section, n: int) -> list[bytes]:
    lines: list[bytes] = []
    at = section.begin
    while at < section.end and len(lines) < n:
        end = text.index(b"\n", at)
        if end - at > MAX_LINE_BYTES:
            raise BadRow(section.first_row + len(lines), TOO_LONG)
        lines.append(text[at:end].strip(b" "))
        at = end + 1
    return lines


def _check_others(head: Head, heading: Heading | None, shape: Shape) -> None:
    """Raise for lines before the first row that may be a heading; one line may be a title."""
    if heading is not None or not head.others:
        return
    line = head.others[-1]
    if len(head.others) > 1 or len(words_of(line)) == shape.n_columns:
        raise UnreadableFile(
            f"the text before line {head.first_line} does not name x, y and z: {shown(line)}",
            remedy="write a heading that names the columns x, y and z, or none",
        )


def _check_last(rows: Rows, sample: list[bytes]) -> None:
    """Raise when the file ends without line end and with less decimals than all rows have: it is cut."""
    if not rows.cut or len(sample) < 10:
        return
    begin = rows.text.rfind(b"\n", 0, len(rows.text) - 1) + 1
    decimals = {len(line.rpartition(b".")[2]) for line in sample[:-1] if re.search(rb"\.\d+$", line)}
    last = rows.text[begin:-1]
    ending = re.search(rb"(?:^|[^\d.])[-+]?(\d*)(?:\.(\d*))?$", last)
    fixed = len(decimals) == 1 and all(re.search(rb"\.\d+$", line) for line in sample[:-1])
    if fixed and ending and len(ending[2] or b"") < decimals.pop():
        raise TruncatedFile(f"the last line has less decimals than the others and no line end: {shown(last)}")


def _notes_of(layout: Layout, heading: Heading | None, head: Head) -> list[Note]:
    notes = []
    if layout.decimal == ",":
        detail = "the text has decimal commas (1,5); they are read as decimal points, nothing is lost"
        notes.append(Note(code="decimal_comma", detail=detail))
    if heading is None and layout.columns == (1, 2, 3):
        detail = (
            "the text: the first column counts the points by one and has no decimals, so x, y and z are read "
            "from columns 2 to 4"
        )
        notes.append(Note(code="numbered_points", detail=detail))
    if head.others:
        detail = (
            f"the text: {len(head.others)} lines before the points are not read, the first is "
            f"{shown(head.others[0])}"
        )
        notes.append(Note(code="lines_not_read", detail=detail))
    if heading is not None and heading.partial:
        detail = "the text: the heading gives a unit for some of x, y and z only, so it is not used"
        notes.append(Note(code="unit_not_used", detail=detail))
    return notes


def _with_positions(clouds: list[FloatArray]) -> tuple[tuple[Body, ...], list[Note]]:
    """A body for each cloud, without points that are NaN, infinite or empty; a note that counts them."""
    finite = [np.isfinite(points).all(axis=1) for points in clouds]
    n_points = sum(len(points) for points in clouds)
    lost = n_points - sum(int(kept.sum()) for kept in finite)
    if lost and n_points - lost < MIN_POINTS:
        raise NotFinite(f"{lost} of {n_points} points have no position: NaN, infinite or empty")
    names = [f"block {at + 1}" if len(clouds) > 1 else "" for at in range(len(clouds))]
    bodies = tuple(
        Body.cloud(points if kept.all() else points[kept], name)
        for points, kept, name in zip(clouds, finite, names, strict=True)
    )
    detail = (
        f"the text: {lost} of {n_points} points have no position (NaN, infinite or empty), where the scanner "
        "saw nothing; they are left out, and nothing else changes"
    )
    return bodies, [Note(code="points_without_position", detail=detail)] if lost else []
