"""Leica PTX: scans on a grid of directions, each with its transform.

Each scan has ten lines and then columns * rows points: number of columns; number of rows; position and
three axes of the scanner, three numbers each; a 4 x 4 transform for row vectors, [x y z 1] @ T, whose last
row is the translation; then x y z intensity, or x y z intensity r g b. A direction without a return is 0 0 0.
Source: Leica Cyclone, as given in Bourke, "ptx plain text data format", 2015, and in the manual of
SpatialAnalyzer.
"""

import numpy as np

from pipeline.core.errors import MeshTooLarge, TruncatedFile, UnreadableFile
from pipeline.core.mesh import FloatArray
from pipeline.core.results import Note
from pipeline.core.settings import LoadSettings
from pipeline.stages.load.contents import Body, Contents
from pipeline.stages.load.point_text_columns import ColumnReader
from pipeline.stages.load.point_text_fields import Shape
from pipeline.stages.load.point_text_head import MAX_SECTIONS, count_of
from pipeline.stages.load.point_text_lines import BadRow, Rows

#: Numbers in the lines of the head of a scan.
HEAD = (1, 1, 3, 3, 3, 3, 4, 4, 4, 4)
#: How far the axes of a transform may be from a rotation, as written with few digits.
RIGID = 1e-3


def is_ptx(rows: Rows) -> bool:
    """Whether the rows start with the head of a scan."""
    lines, _ = _lines(rows.text, 0, len(HEAD))
    return (
        len(lines) == len(HEAD)
        and count_of(lines[0]) is not None
        and count_of(lines[1]) is not None
        and all(_numbers(line, n) is not None for line, n in zip(lines[2:], HEAD[2:], strict=True))
    )


def read_ptx(rows: Rows, settings: LoadSettings) -> Contents:
    """One cloud for each scan, with its transform applied, without the directions that have no return.

    Raises
    ------
    TruncatedFile, UnreadableFile, MeshTooLarge
        With the scan and the line.
    """
    bodies: list[Body] = []
    notes: list[Note] = []
    at, row, n_cells, n_left, n_lines = 0, 0, 0, 0, rows.text.count(b"\n")
    while at < len(rows.text):
        name = f"scan {len(bodies) + 1}"
        lines, at = _lines(rows.text, at, len(HEAD))
        n_columns, n_rows, position, transform = _head(lines, rows, row, name)
        row += len(HEAD)
        n_cells += n_columns * n_rows
        follow = n_lines - row
        if n_columns * n_rows > follow:
            raise TruncatedFile(
                f"{name} of the PTX has {n_columns} columns of {n_rows} points, which is "
                f"{n_columns * n_rows} lines, and {follow} lines follow"
            )
        if len(bodies) == MAX_SECTIONS:
            raise MeshTooLarge(f"more than {MAX_SECTIONS} scans in the PTX", remedy="split the file")
        end = _end_of(rows.text, at, n_columns * n_rows)
        points = _points(rows, at, end, row)
        at, row = end, row + n_columns * n_rows
        measured = np.isfinite(points).all(axis=1) & (points != 0.0).any(axis=1)
        n_left += int(measured.sum())
        if n_left > settings.max_points:
            raise MeshTooLarge(f"more than {settings.max_points} points, which is the limit")
        if not _is_rigid(transform):
            detail = f"the PTX: the transform of {name} is no rotation; it is applied as it is"
            notes.append(Note(code="ptx_transform", detail=detail))
        with np.errstate(over="ignore", invalid="ignore"):  # what is too far away is reported for the mesh
            moved = points[measured] @ transform[:3, :3] + transform[3, :3]
        bodies.append(Body.cloud(moved, name, _scanner(position, transform)))
    if n_cells > n_left:
        detail = (
            f"the PTX: {n_cells - n_left} of {n_cells} directions have no return (0 0 0); they are left out, "
            "and nothing else changes"
        )
        notes.append(Note(code="points_without_position", detail=detail))
    return Contents(tuple(bodies), None, tuple(notes))


def _scanner(position: FloatArray, transform: FloatArray) -> FloatArray | None:
    """Where the scanner stood (3,): the origin of its points, where the head says the same of it; a rotation
    and a position that do not belong together say nothing.
    """
    origin = transform[3, :3]
    near = np.abs(position - origin).max() <= RIGID * max(1.0, float(np.abs(origin).max()))
    return origin if near and _is_rigid(transform) else None


def _head(lines: list[bytes], rows: Rows, row: int, name: str) -> tuple[int, int, FloatArray, FloatArray]:
    """Columns, rows, position (3,) of the scanner and transform (4, 4)."""
    for at, (line, n) in enumerate(zip(lines, HEAD, strict=False)):
        if _numbers(line, n) is None or (n == 1 and count_of(line) is None):
            what = "one whole number" if n == 1 else f"{n} numbers"
            raise rows.refused(BadRow(row + at, f"should have {what}, in the head of {name} of the PTX"))
    if len(lines) < len(HEAD):
        raise TruncatedFile(f"the PTX ends within the head of {name}")
    transform = np.array([_numbers(line, 4) for line in lines[6:]])
    if not np.isfinite(transform).all() or (transform[:, 3] != (0.0, 0.0, 0.0, 1.0)).any():
        raise UnreadableFile(
            f"the transform of {name} of the PTX does not have 0 0 0 1 as last column, so where its "
            "translation is, is not certain",
            remedy="export the scans again, or without transform",
        )
    if abs(np.linalg.det(transform[:3, :3])) < RIGID**3:
        raise UnreadableFile(
            f"the transform of {name} of the PTX maps all points to a plane, a line or a point",
            remedy="export the scans again, or without transform",
        )
    return int(lines[0]), int(lines[1]), np.array(_numbers(lines[2], 3)), transform


def _is_rigid(transform: FloatArray) -> bool:
    axes = transform[:3, :3]
    if np.abs(axes).max() > 1.0 + RIGID:  # its squares may overflow
        return False
    return bool(np.abs(axes @ axes.T - np.eye(3)).max() < RIGID and np.linalg.det(axes) > 0)


def _points(rows: Rows, at: int, end: int, row: int) -> FloatArray:
    """(n, 3) of the lines from `at` to `end`."""
    text = rows.text[at:end]
    n_columns = len(text[: text.find(b"\n")].split())
    if not text:
        return np.zeros((0, 3))
    if n_columns not in (3, 4, 6, 7):
        raise rows.refused(
            BadRow(
                row,
                f"has {n_columns} columns, and a point of a PTX has 4 (x y z intensity) or 7 (with r g b)",
            )
        )
    reader = ColumnReader(Shape(" ", n_columns), (0, 1, 2))
    try:
        points = reader.read(text, row)
    except BadRow as bad:
        raise rows.refused(bad) from None
    if reader.evidence.first_comma is not None:
        raise rows.refused(BadRow(reader.evidence.first_comma, "has a comma in a number"))
    return points


def _lines(text: bytes, at: int, n: int) -> tuple[list[bytes], int]:
    """Up to n lines from `at`, and where the next starts."""
    lines: list[bytes] = []
    while at < len(text) and len(lines) < n:
        end = text.index(b"\n", at)
        lines.append(text[at:end])
        at = end + 1
    return lines, at


def _end_of(text: bytes, at: int, n: int) -> int:
    """Where the line after n lines starts."""
    while n:
        block = np.frombuffer(
            text, dtype=np.uint8, count=min(len(text) - at, max(64, min(n, 1 << 16) * 64)), offset=at
        )
        ends = np.flatnonzero(block == 10)
        if len(ends) >= n:
            return at + int(ends[n - 1]) + 1
        at, n = at + len(block), n - len(ends)
    return at


def _numbers(line: bytes, n: int) -> list[float] | None:
    if len(line) > 1000:
        return None
    try:
        numbers = [float(word) for word in line.split()]
    except ValueError:
        return None
    return numbers if len(numbers) == n and b"_" not in line else None
