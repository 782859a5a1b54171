"""The statements of a Wavefront OBJ: vertices, faces, points, objects, and what else the file has.

Source: Wavefront Advanced Visualizer, appendix B1 "Object Files (.obj)", version 3.0.
"""

import re
from collections import Counter
from dataclasses import dataclass, field

import numpy as np

from pipeline.core.errors import IndexOutOfRange, MeshTooLarge, UnreadableFile
from pipeline.core.formats import Format
from pipeline.core.mesh import FloatArray, IndexArray
from pipeline.core.settings import LoadSettings
from pipeline.stages.load.obj_text import with_decimal_points, with_joined_lines, without_comments
from pipeline.stages.load.text_words import (
    Words,
    blocks,
    integers,
    numbers,
    plain_lines,
    shown,
    words_of,
)

#: Statements that say nothing about polygons: appearance, groups, display, parts of free-form statements.
SILENT = frozenset(
    b"vn vt vp g s mg usemtl mtllib usemap maplib bevel c_interp d_interp lod shadow_obj trace_obj ctech "
    b"stech cstype deg bmat step parm trim hole scrv sp end con res bsp bzp cdc cdp csh".split()
)
#: Statements that place a curve or surface.
FREE_FORM = frozenset((b"curv", b"curv2", b"surf", b"bsp", b"bzp", b"cdc", b"cdp"))
_KEYWORD = re.compile(rb"[A-Za-z_]{2,32}")


@dataclass(slots=True, eq=False)
class Elements:
    """Elements of one kind, faces or points. corners : (sum of counts,) vertex of each, from 0; counts,
    lines : (n,) corners of each, and its line in the file
    """

    corners: IndexArray
    counts: IndexArray
    lines: IndexArray


@dataclass(frozen=True, slots=True, eq=False)
class Statements:
    """vertices : (n, 3), lines : (n,) of them; objects, groups : name of each `o` and `g`, and the number of
    faces before it; free_form, unknown : statements that are not read, by keyword; decimal_comma : numbers
    that were written with one
    """

    vertices: FloatArray
    vertex_lines: IndexArray
    faces: Elements
    points: Elements
    objects: list[tuple[str, int]]
    groups: list[tuple[str, int]]
    lines: int
    free_form: Counter[str]
    unknown: Counter[str]
    decimal_comma: int


def read_statements(data: bytes, settings: LoadSettings) -> Statements:
    """All statements of an OBJ.

    Raises
    ------
    UnreadableFile, IndexOutOfRange, MeshTooLarge
        With the line.
    """
    text = with_joined_lines(plain_lines(data))
    text, commas = with_decimal_points(text)
    collector = _Collector(settings)
    for block, line_number in blocks(text):
        collector.take(words_of(without_comments(block), line_number))
    return collector.statements(commas)


@dataclass(slots=True, eq=False)
class _Collector:
    settings: LoadSettings
    vertices: list[FloatArray] = field(default_factory=list)
    vertex_lines: list[IndexArray] = field(default_factory=list)
    faces: list[Elements] = field(default_factory=list)
    points: list[Elements] = field(default_factory=list)
    objects: list[tuple[str, int]] = field(default_factory=list)
    groups: list[tuple[str, int]] = field(default_factory=list)
    n_vertices: int = 0
    n_faces: int = 0
    lines: int = 0
    free_form: Counter[str] = field(default_factory=Counter)
    unknown: Counter[str] = field(default_factory=Counter)

    def take(self, words: Words) -> None:
        counts = words.counts
        lines = np.flatnonzero(counts > 0)
        key = words.first[lines]
        letter = words.text[words.starts[key]]
        length = words.ends[key] - words.starts[key]
        second = words.text[np.minimum(words.starts[key] + 1, len(words.text) - 1)]
        single = length == 1
        vertex = single & (letter == ord("v"))
        # `fo` is the old word for `f` (specification, "Superseded statements")
        face = (letter == ord("f")) & (single | ((length == 2) & (second == ord("o"))))
        point = single & (letter == ord("p"))
        segment = single & (letter == ord("l"))
        attribute = (length == 2) & (letter == ord("v")) & np.isin(second, list(b"ntp"))
        other = ~(vertex | face | point | segment | attribute | (letter == ord("#")))

        before = self.n_vertices + np.cumsum(vertex)
        faces_before = self.n_faces + np.cumsum(face)
        self._take_vertices(words, lines[vertex])
        if face.any():
            self.faces.append(self._elements(words, lines[face], before[face], "face"))
        if point.any():
            self.points.append(self._elements(words, lines[point], before[point], "point"))
        self.n_faces += int(face.sum())
        self.lines += int(segment.sum())
        for index in np.flatnonzero(other):
            self._take_other(words, int(lines[index]), int(faces_before[index]))

    def _take_vertices(self, words: Words, lines: IndexArray) -> None:
        self.n_vertices += len(lines)
        if self.n_vertices > self.settings.max_vertices:
            raise MeshTooLarge(
                f"the {Format.OBJ} has more than {self.settings.max_vertices} vertices, which is the limit"
            )
        self.vertices.append(numbers(words, lines, 3, Format.OBJ, skip=1))
        self.vertex_lines.append(lines + words.line_number)

    def _elements(self, words: Words, lines: IndexArray, before: IndexArray, what: str) -> Elements:
        """Elements with their indices from 0; `before`: (n,) vertices in the file before each."""
        counts = words.counts[lines] - 1
        owner = np.repeat(np.arange(len(lines)), counts)
        index = np.arange(len(owner)) + (words.first[lines] + 1 - np.cumsum(counts) + counts)[owner]
        raw, good = integers(words, index, stop_at="/")

        def fault(corner: int, text: str) -> str:
            return f"line {words.place(lines[owner[corner]])} of the {Format.OBJ}: {text}"

        if not good.all():
            corner = int(np.flatnonzero(~good)[0])
            word = shown(words.word(int(index[corner])))
            raise UnreadableFile(
                fault(corner, f"{word} is no corner of a {what}, which is the number of a vertex")
            )
        corners = np.where(raw < 0, before[owner] + raw, raw - 1)
        outside = np.flatnonzero((corners < 0) | (raw == 0))
        if outside.size:
            corner = int(outside[0])
            if raw[corner] == 0:
                reason = f"the {what} refers to vertex 0, but the first vertex has number 1"
            else:
                reason = (
                    f"the {what} refers to vertex {raw[corner]}, counted back from that line, "
                    f"but only {before[owner[corner]]} vertices come before it"
                )
            raise IndexOutOfRange(fault(corner, reason))
        return Elements(corners, counts, lines + words.line_number)

    def _take_other(self, words: Words, line: int, faces_before: int) -> None:
        key = words.word(int(words.first[line]))
        if key in FREE_FORM:
            self.free_form[key.decode()] += 1
        if key in (b"o", b"g"):
            name = b" ".join(words.of_line(line)[1:]).decode("utf-8", errors="replace")
            (self.objects if key == b"o" else self.groups).append((name, faces_before))
            return
        if key in SILENT or key in FREE_FORM:
            return
        if key == b"call":
            raise UnreadableFile(
                f"line {words.place(line)} of the {Format.OBJ} includes another file (call), "
                "which was not sent",
                remedy="export the mesh as one file",
            )
        if _KEYWORD.fullmatch(key):
            self.unknown[key.decode()] += 1
        else:
            raise UnreadableFile(
                f"line {words.place(line)} of the {Format.OBJ} starts with {shown(key)}, "
                "which is no statement"
            )

    def statements(self, decimal_comma: int) -> Statements:
        none = np.zeros(0, dtype=np.int64)
        vertices = np.concatenate([np.zeros((0, 3)), *self.vertices])
        faces, points = (
            Elements(
                np.concatenate([none, *(each.corners for each in group)]),
                np.concatenate([none, *(each.counts for each in group)]),
                np.concatenate([none, *(each.lines for each in group)]),
            )
            for group in (self.faces, self.points)
        )
        for elements, what in ((faces, "face"), (points, "point")):
            _check_indices(elements, len(vertices), what)
        return Statements(
            vertices,
            np.concatenate([none, *self.vertex_lines]),
            faces,
            points,
            self.objects,
            self.groups,
            self.lines,
            self.free_form,
            self.unknown,
            decimal_comma,
        )


def _check_indices(elements: Elements, n_vertices: int, what: str) -> None:
    outside = np.flatnonzero(elements.corners >= n_vertices)
    if outside.size:
        corner = int(outside[0])
        element = int(np.searchsorted(np.cumsum(elements.counts), corner, side="right"))
        raise IndexOutOfRange(
            f"line {elements.lines[element]} of the {Format.OBJ}: the {what} refers to vertex "
            f"{elements.corners[corner] + 1}, but there are {n_vertices}"
        )
