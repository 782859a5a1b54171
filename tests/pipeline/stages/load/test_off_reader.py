"""An OFF is read in all its forms, text and binary, or refused with what is wrong and where.

All files are made here. The dialect of each is named with its source: the manual of Geomview 1.9, section
4.2.5 (http://www.geomview.org/docs/html/OFF.html), or a public issue.
"""

import struct
from random import Random

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.core import errors
from pipeline.core.formats import Format, detect_format
from pipeline.core.settings import LoadSettings
from pipeline.stages.load import text_words
from pipeline.stages.load.contents import Contents, joined
from pipeline.stages.load.off import read_off
from tests.support import shapes

BOX = shapes.box((1.0, 2.0, 3.0))
POINTS = "0 0 0\n1 0 0\n1 1 0\n0 1 0\n"
CORNERS = np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)], dtype=float)
HALVES = [[0, 1, 2], [0, 2, 3]]
FACES = "3 0 1 2\n3 0 2 3\n"
PLAIN = f"OFF\n4 2 0\n{POINTS}{FACES}"


def read(text: str | bytes, **settings: int) -> Contents:
    data = text if isinstance(text, bytes) else text.encode()
    return read_off(data, LoadSettings(**settings))


def rows(more: str) -> str:
    return POINTS.replace("\n", f" {more}\n")


def binary(
    head: str = "OFF BINARY\n", more: int = 0, colours: tuple[int, ...] = (0, 0), dimension: bool = False
) -> bytes:
    table = np.hstack([CORNERS, np.full((4, more), 0.5)]).astype(">f4").tobytes()
    counts = struct.pack(">3i", 4, 2, 5)
    faces = b"".join(
        struct.pack(f">5i{n}f", 3, *face, n, *[0.25] * n) for face, n in zip(HALVES, colours, strict=True)
    )
    return head.encode() + (struct.pack(">i", 3) if dimension else b"") + counts + table + faces


#: Each gives the square of two triangles.
DIALECTS: dict[str, str | bytes] = {
    "plain": PLAIN,
    "CRLF": PLAIN.replace("\n", "\r\n"),
    "CR": PLAIN.replace("\n", "\r"),
    "byte order mark": "\ufeff" + PLAIN,
    "no last line feed": PLAIN.rstrip(),
    # https://github.com/fougue/mayo/issues/258, https://github.com/MeshInspector/MeshLib/pull/3552
    "counts beside the word": PLAIN.replace("OFF\n", "OFF "),
    # https://github.com/PyMesh/PyMesh/issues/162 (ModelNet40)
    "counts glued to the word": PLAIN.replace("OFF\n", "OFF"),
    "no edges": PLAIN.replace("4 2 0", "4 2"),
    "comments and blank lines": f"OFF # x\n# a\n\n4 2 0 # n\n\n{rows('# p')}\n#\n \t{FACES}#",
    "quad": f"OFF\n4 1 4\n{POINTS}4 0 1 2 3\n",
    # colorspec: nothing, an index, or 3 or 4 integers or floats, up to the end of the line
    "colours of faces": f"OFF\n4 2 0\n{POINTS}3 0 1 2 255 0 0\n3 0 2 3 0.5 0.5 0.5 1.0\n",
    "index of a colour": f"OFF\n4 2 0\n{POINTS}3 0 1 2 7\n3 0 2 3\n",
    "COFF": f"COFF\n4 2 0\n{rows('255 0 0 255')}{FACES}",
    # https://github.com/cnr-isti-vclab/meshlab/issues/292: colours without the C
    "colours of vertices in an OFF": f"OFF\n4 2 0\n{rows('1 0 0')}{FACES}",
    "NOFF": f"NOFF\n4 2 0\n{rows('0 0 1')}{FACES}",
    "STOFF": f"STOFF\n4 2 0\n{rows('0.5 0.5')}{FACES}",
    # MeshLab: letters in another order, and the colour before the normal
    "NCOFF": f"NCOFF\n4 2 0\n{rows('255 0 0 255 0 0 1')}{FACES}",
    "STCNOFF": f"STCNOFF\n4 2 0\n{rows('0 0 1 1 0 0 1 0.5 0.5')}{FACES}",
    "4OFF": f"4OFF\n4 2 0\n0 0 0 1\n2 0 0 2\n-1 -1 0 -1\n0 .5 0 .5\n{FACES}",
    "nOFF": f"nOFF 3\n4 2 0\n{POINTS}{FACES}",
    "nOFF, dimension on its line": f"nOFF\n3\n4 2 0\n{POINTS}{FACES}",
    # line breaks count for colours only
    "free form": "OFF 4 2 0 " + (POINTS + FACES).replace("\n", "  "),
    "free form, two vertices on a line": "OFF\n4 2 0\n0 0 0 1 0 0\n1 1 0 0 1 0\n3 0\n1 2\n3 0 2 3\n",
    "free form, NOFF": "NOFF\n4 2 0\n" + (rows("0 0 1").replace(" 0 0 1\n", "\n0 0 1\n") + FACES),
    # section 4.1.6
    "binary": binary(),
    "binary with colours": binary(colours=(3, 4)),
    "binary with one colour": binary(colours=(0, 4)),
    "binary COFF": binary("COFF BINARY\n", 4),
    "binary STCN": binary("STCNOFF  BINARY \n", 9),
    "binary 4OFF": binary("4OFF BINARY\n", 1).replace(struct.pack(">f", 0.5), struct.pack(">f", 1.0)),
    "binary nOFF": binary("nOFF BINARY\n", dimension=True),
}


@pytest.mark.parametrize("dialect", DIALECTS)
def test_each_dialect_gives_the_square(dialect: str) -> None:
    contents = read(DIALECTS[dialect])
    vertices, faces = joined(contents)
    np.testing.assert_array_equal(vertices, CORNERS)
    assert faces.tolist() == HALVES
    assert contents.notes == () and contents.unit is None


def test_vertices_without_faces_are_points() -> None:
    (cloud,) = read(f"OFF\n4 0 0\n{POINTS}").bodies
    np.testing.assert_array_equal(cloud.vertices, CORNERS)
    assert len(cloud.faces) == 0


def test_all_vertices_are_kept_in_their_order() -> None:
    vertices, faces = joined(read(f"OFF\n5 1 0\n9 9 9\n{POINTS}3 1 2 3\n"))
    np.testing.assert_array_equal(vertices[1:], CORNERS)
    assert len(vertices) == 5 and faces.tolist() == [[1, 2, 3]]


@given(st.lists(st.tuples(*[st.floats(-1e12, 1e12)] * 3), min_size=3, max_size=20), st.randoms())
def test_numbers_are_read_exactly_whatever_the_line_breaks(
    points: list[tuple[float, float, float]], random: Random
) -> None:
    words = [*(repr(x) for point in points for x in point), "3", "0", "1", "2", "3", "2", "1", "0"]
    text = "".join(word + random.choice([" ", "\n"]) for word in words)
    lined = "\n".join(" ".join(map(repr, point)) for point in points) + "\n3 0 1 2\n3 2 1 0\n"
    for content in (text, lined):
        vertices, faces = joined(read(f"OFF\n{len(points)} 2 0\n{content}"))
        np.testing.assert_array_equal(vertices, points)
        assert faces.tolist() == [[0, 1, 2], [2, 1, 0]]


def test_blocks_do_not_change_what_is_read(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(text_words, "BLOCK", 8)
    vertices, faces = joined(read(PLAIN))
    np.testing.assert_array_equal(vertices, CORNERS)
    assert faces.tolist() == HALVES


@pytest.mark.parametrize(
    ("text", "code", "words"),
    [
        (f"OFF\n4 4 0\n{POINTS}{FACES}2 0 1\n0\n", "left_out_of_off", "2 faces with fewer than 3"),
        (f"{PLAIN}3 0 1 3\n", "left_out_of_off", "1 line after the last of the 2"),
        (binary() + b"abc", "left_out_of_off", "3 bytes after"),
        (PLAIN.replace("1 0 0\n", "1,0 0 0\n"), "decimal_comma", "1 vertices"),
    ],
)
def test_what_is_not_as_announced_is_noted(text: str | bytes, code: str, words: str) -> None:
    contents = read(text)
    np.testing.assert_array_equal(joined(contents)[0], CORNERS)
    (note,) = contents.notes
    assert note.code == code and words in note.detail


REFUSED: dict[str, tuple[str | bytes, type[errors.PipelineError], str]] = {
    "cut in the vertices": (PLAIN[:18], errors.TruncatedFile, "4 vertices and 2 faces, and has 1 and 0"),
    "cut in the faces": (PLAIN[:-9], errors.TruncatedFile, "4 vertices and 2 faces, and has 4 and 1"),
    "cut in a face": (PLAIN[:-3], errors.TruncatedFile, "has 4 and 1"),
    "cut in the counts": ("OFF\n4", errors.UnreadableFile, "before its counts"),
    "a billion vertices": ("OFF\n1000000000 9 0\n0 0 0\n", errors.TruncatedFile, "1000000000 vertices"),
    "binary cut": (binary()[:-3], errors.TruncatedFile, "has 4 and 1"),
    "binary cut in the vertices": (binary()[:50], errors.TruncatedFile, "has 2 and 0"),
    "binary cut in the counts": (binary()[:20], errors.UnreadableFile, "before its counts"),
    "binary, a billion": (
        b"OFF BINARY\n" + struct.pack(">3i", 10**9, 1, 0) + b"\0" * 24,
        errors.TruncatedFile,
        "has 2 and 0",
    ),
    "binary negative": (b"OFF BINARY\n" + struct.pack(">3i", 1, -1, 0), errors.UnreadableFile, "-1"),
    "binary index": (
        binary().replace(struct.pack(">3i", 0, 2, 3), struct.pack(">3i", 0, 2, 9)),
        errors.IndexOutOfRange,
        "face 1 .* vertex 9",
    ),
    "binary NaN": (
        binary().replace(struct.pack(">f", 1), struct.pack(">f", np.nan), 1),
        errors.NotFinite,
        "index 1",
    ),
    "counts are words": ("OFF\nfour 2 0\n", errors.UnreadableFile, "'four'"),
    "negative counts": ("OFF\n4 -2 0\n", errors.UnreadableFile, "-2 faces"),
    "index": (PLAIN.replace("3 0 2 3", "3 0 2 4"), errors.IndexOutOfRange, "face 1 .* line 8, .* vertex 4"),
    "negative index": (PLAIN.replace("3 0 2 3", "3 0 2 -1"), errors.IndexOutOfRange, "vertex -1"),
    "short face": (PLAIN.replace("3 0 1 2", "4 0 1 2"), errors.UnreadableFile, "face 0 .* line 7, .* 4"),
    "corner is no number": (PLAIN.replace("3 0 1 2", "3 0 b 2"), errors.UnreadableFile, "line 7 .*'b'"),
    "no count": (PLAIN.replace("3 0 1 2", "x 0 1 2"), errors.UnreadableFile, "line 7 .*'x'"),
    "word": (PLAIN.replace("1 1 0", "1 one 0"), errors.UnreadableFile, "line 5 of the off has 'one'"),
    "commas between": (PLAIN.replace("1 1 0", "1.0, 1, 0"), errors.UnreadableFile, "line 5 .*commas"),
    "NaN": (PLAIN.replace("1 1 0", "1 nan 0"), errors.NotFinite, "line 5"),
    "at infinity": (f"4OFF\n4 2 0\n{rows('0')}{FACES}", errors.UnreadableFile, "vertex 0 .*infinity"),
    "nOFF of 4": (f"nOFF 4\n4 2 0\n{rows('0')}{FACES}", errors.UnreadableFile, "nOFF with vertices of 4"),
    "4nOFF": (f"4nOFF 3\n4 2 0\n{rows('1')}{FACES}", errors.UnreadableFile, "4nOFF"),
    # Stella4D: the fourth count is of cells (https://www.software3d.com/StellaManual.php?prod=stella4D)
    "polytope": (f"4OFF\n4 2 0 1\n{rows('1')}{FACES}", errors.UnreadableFile, "cells"),
    "edges only": (f"OFF\n4 1 0\n{POINTS}2 0 1\n", errors.UnreadableFile, "fewer than 3 corners"),
    "nothing": ("OFF\n0 0 0\n", errors.UnreadableFile, "no vertices"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_a_bad_file_is_refused_with_its_place(case: str) -> None:
    text, error, words = REFUSED[case]
    with pytest.raises(error, match=words) as caught:
        read(text)
    assert len(caught.value.remedy) > 10


def test_sizes_beyond_the_limits_are_refused() -> None:
    with pytest.raises(errors.MeshTooLarge, match="2 triangles and 4 vertices; the limits are 1 and"):
        read(PLAIN, max_faces=1)
    with pytest.raises(errors.MeshTooLarge, match="1 triangles and 4 vertices"):
        read(f"OFF\n4 1 0\n{POINTS}3 0 1 2\n", max_points=3)


@pytest.mark.parametrize("dialect", DIALECTS)
def test_each_dialect_is_detected(dialect: str) -> None:
    text = DIALECTS[dialect]
    data = text if isinstance(text, bytes) else text.encode()
    assert detect_format(data, len(data)) is Format.OFF


def test_a_signalling_nan_of_a_binary_file_is_not_finite() -> None:
    nan = b"\x7f\x80\x00\x01"  # found by fuzzing: numpy warns where it is cast
    points = nan + struct.pack(">8f", 0, 0, 1, 0, 0, 0, 1, 0)
    data = b"OFF BINARY\n" + struct.pack(">3i", 3, 1, 0) + points + struct.pack(">5i", 3, 0, 1, 2, 0)
    with pytest.raises(errors.NotFinite, match="1 of 3 vertices"):
        read(data)
