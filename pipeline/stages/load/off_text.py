"""OFF as text: a line for each vertex and face, or numbers in free form."""

import re
from dataclasses import dataclass, field
from itertools import islice

import numpy as np

from pipeline.core.errors import PipelineError, UnreadableFile
from pipeline.core.formats import Format
from pipeline.core.mesh import FloatArray, IndexArray
from pipeline.stages.load.off_records import (
    Header,
    Polygons,
    check_counts,
    check_dimension,
    check_indices,
    in_space,
    truncated,
)
from pipeline.stages.load.text_words import (
    Words,
    ambiguous_comma,
    blocks,
    integers,
    is_decimal_comma,
    numbers,
    plain_lines,
    shown,
    words_of,
)

_LINE = re.compile(rb"[^\n]*\n?")


@dataclass(slots=True, eq=False)
class _Rows:
    """What the lines have given so far; last_line : number of the last line that is not blank."""

    n_vertices: int
    n_faces: int
    last_line: int
    vertices: list[FloatArray] = field(default_factory=list)
    vertex_lines: list[IndexArray] = field(default_factory=list)
    corners: list[IndexArray] = field(default_factory=list)
    counts: list[IndexArray] = field(default_factory=list)
    face_lines: list[IndexArray] = field(default_factory=list)
    vertices_read: int = 0
    faces_read: int = 0
    trailing: int = 0


def read_text(data: bytes, header: Header) -> Polygons:
    """The polygons of an OFF that is text.

    Raises
    ------
    TruncatedFile, UnreadableFile, IndexOutOfRange
        With the line or the face.
    """
    before = data[: header.start]
    text = plain_lines(re.sub(rb"#[^\n]*", b"", data[header.start :]))
    line_number = plain_lines(before).count(b"\n") + 1
    (n_vertices, n_faces), start = _counts(text, header)
    line_number += text.count(b"\n", 0, start)
    text, commas = _with_decimal_points(text, start, line_number, n_vertices)
    last_line = line_number + text.count(b"\n", start, len(text.rstrip()))
    rows, fault = _Rows(n_vertices, n_faces, last_line), None
    try:
        _read_rows(text, start, line_number, header, rows)
    except PipelineError as error:
        fault = error
    if fault is not None or rows.trailing:
        # Numbers may also stand in other lines than one for each vertex and face.
        free = _free_form(text[start:], header, n_vertices, n_faces)
        if free is not None:
            check_indices(free.corners, free.counts, n_vertices, None)
            return free
    if fault is not None:
        raise fault
    none = np.zeros(0, dtype=np.int64)
    corners, counts = np.concatenate([none, *rows.corners]), np.concatenate([none, *rows.counts])
    check_indices(corners, counts, n_vertices, np.concatenate([none, *rows.face_lines]))
    vertices = np.concatenate([np.zeros((0, header.coordinates)), *rows.vertices])
    return Polygons(
        in_space(vertices),
        np.concatenate([none, *rows.vertex_lines]),
        corners,
        counts,
        _trailing(rows.trailing),
        commas,
    )


def _trailing(lines: int) -> str:
    return "" if lines == 0 else "1 line" if lines == 1 else f"{lines} lines"


def _counts(text: bytes, header: Header) -> tuple[tuple[int, int], int]:
    """Announced vertices and faces, and where the vertices start. The number of edges may be absent."""
    words: list[bytes] = []
    start, needed = 0, 3 if header.n_dimensions else 2
    while len(words) < needed:
        if start >= len(text):
            raise UnreadableFile(f"the {Format.OFF} ends before its counts of vertices and faces")
        line = _LINE.match(text, start)
        if line is None:
            break
        row = line[0].split()
        if len(words) + len(row) > needed + 1:  # the vertices follow on the same line
            row = row[: needed + 1 - len(words)]
            if header.homogeneous and len(line[0].split()) == needed + 2:
                raise UnreadableFile(
                    f"the 4{Format.OFF} announces cells: it is a four-dimensional polytope, not a part",
                    remedy="export a mesh of three dimensions",
                )
            start += _end_of_words(line[0], len(row))
        else:
            start = line.end()
        words += row
    values = []
    for word in words:
        if not re.fullmatch(rb"[-+]?\d{1,18}", word):
            raise UnreadableFile(f"the {Format.OFF} has {shown(word)} where its counts should be")
        values.append(int(word))
    if header.n_dimensions:
        check_dimension(header, values.pop(0))
    check_counts(values[0], values[1])
    return (values[0], values[1]), start


def _end_of_words(line: bytes, count: int) -> int:
    end = 0
    for match in islice(re.finditer(rb"\S+", line), count):
        end = match.end()
    return end


def _with_decimal_points(text: bytes, start: int, line_number: int, n_vertices: int) -> tuple[bytes, int]:
    """The text with decimal commas as points, and how many vertices have them."""
    if b"," not in text:
        return text, 0
    commas, first, clear, seen, position = 0, 0, True, 0, start
    while seen < n_vertices and position < len(text):
        end = (text.find(b"\n", position) + 1) or len(text)
        row = text[position:end]
        words = row.split()
        if words:
            seen += 1
            clear = clear and is_decimal_comma(words)
            if b"," in row:
                first = first or line_number
                commas += 1
        position, line_number = end, line_number + 1
    if commas and not clear:
        raise ambiguous_comma(Format.OFF, first)
    return (text.replace(b",", b"."), commas) if commas else (text, 0)


def _read_rows(text: bytes, start: int, line_number: int, header: Header, rows: _Rows) -> None:
    """One line for each vertex, then one for each face; further numbers on a line are not used."""
    for block, number in blocks(text, start, line_number):
        words = words_of(block, number)
        lines = np.flatnonzero(words.counts > 0)
        of_vertices = lines[: rows.n_vertices - rows.vertices_read]
        if len(of_vertices) and words.place(of_vertices[-1]) == rows.last_line:
            whole = rows.vertices_read + len(of_vertices)
            if words.counts[of_vertices[-1]] < header.coordinates:  # the file ends within a vertex
                raise truncated((rows.n_vertices, rows.n_faces), (whole - 1, 0))
        rows.vertices.append(numbers(words, of_vertices, header.coordinates, Format.OFF))
        rows.vertex_lines.append(of_vertices + words.line_number)
        rows.vertices_read += len(of_vertices)
        lines = lines[len(of_vertices) :]
        of_faces = lines[: rows.n_faces - rows.faces_read]
        _take_faces(words, of_faces, rows)
        rows.trailing += len(lines) - len(of_faces)
    if rows.vertices_read < rows.n_vertices or rows.faces_read < rows.n_faces:
        raise truncated((rows.n_vertices, rows.n_faces), (rows.vertices_read, rows.faces_read))


def _take_faces(words: Words, lines: IndexArray, rows: _Rows) -> None:
    first = words.first[lines]
    counts, good = integers(words, first)
    if not good.all() or (counts < 0).any():
        bad = int(np.flatnonzero(~good | (counts < 0))[0])
        word = shown(words.word(int(first[bad])))
        raise UnreadableFile(
            f"line {words.place(lines[bad])} of the {Format.OFF} starts with {word}, "
            "which is no number of corners"
        )
    short = np.flatnonzero(words.counts[lines] - 1 < counts)
    if short.size:
        bad = int(short[0])
        present = int(words.counts[lines[bad]]) - 1
        face = rows.faces_read + bad
        if words.place(lines[bad]) == rows.last_line:
            raise truncated((rows.n_vertices, rows.n_faces), (rows.n_vertices, face))
        raise UnreadableFile(
            f"face {face} (the first is 0) of the {Format.OFF}, on line {words.place(lines[bad])}, announces "
            f"{counts[bad]} corners and has {present}"
        )
    owner = np.repeat(np.arange(len(lines)), counts)
    index = np.arange(len(owner)) + (first + 1 - np.cumsum(counts) + counts)[owner]
    corners, good = integers(words, index)
    if not good.all():
        bad = int(np.flatnonzero(~good)[0])
        word = shown(words.word(int(index[bad])))
        raise UnreadableFile(
            f"line {words.place(lines[owner[bad]])} of the {Format.OFF}: {word} is no corner of a face: "
            "it is no number of a vertex"
        )
    rows.corners.append(corners)
    rows.counts.append(counts)
    rows.face_lines.append(lines + words.line_number)
    rows.faces_read += len(lines)


def _free_form(text: bytes, header: Header, n_vertices: int, n_faces: int) -> Polygons | None:
    """The same with any line breaks, when the numbers are exactly as many as announced; None otherwise."""
    try:
        values = np.fromstring(text.decode("ascii"), dtype=np.float64, sep=" ")
    except (ValueError, DeprecationWarning):
        return None
    end = header.width * n_vertices
    if len(values) < end + n_faces:
        return None
    coordinates = values[:end].reshape(n_vertices, header.width)[:, : header.coordinates]
    rest = values[end:]
    if not np.isfinite(values).all() or (rest != np.floor(rest)).any() or np.abs(rest).max(initial=0) > 2**53:
        return None
    numbers_of_faces = rest.astype(np.int64).tolist()
    corners: list[int] = []
    counts: list[int] = []
    position = 0
    while position < len(numbers_of_faces) and len(counts) < n_faces:
        count = numbers_of_faces[position]
        if count < 0:
            return None
        corners += numbers_of_faces[position + 1 : position + 1 + count]
        counts.append(count)
        position += 1 + count
    if position != len(numbers_of_faces) or len(counts) != n_faces:
        return None
    return Polygons(
        in_space(coordinates), None, np.array(corners, dtype=np.int64), np.array(counts, dtype=np.int64)
    )
