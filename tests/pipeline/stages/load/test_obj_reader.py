"""An OBJ is read as its specification and exporters mean it, or refused with the line that is wrong.

All files are made here. The dialect of each is named with its source: the specification ("Object Files
(.obj)", version 3.0, https://paulbourke.net/dataformats/obj/) or a public issue.
"""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.core import errors
from pipeline.core.formats import Format, detect_format
from pipeline.core.mesh import FloatArray
from pipeline.core.settings import LoadSettings
from pipeline.stages.load import text_words
from pipeline.stages.load.contents import Contents, joined
from pipeline.stages.load.obj import read_obj
from tests.support import shapes

BOX = shapes.box((1.0, 2.0, 3.0))
SQUARE = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n"
CORNERS = np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)], dtype=float)
HALVES = [[0, 1, 2], [0, 2, 3]]


def read(text: str | bytes, **settings: int) -> Contents:
    data = text if isinstance(text, bytes) else text.encode()
    return read_obj(data, LoadSettings(**settings))


def corners(contents: Contents) -> FloatArray:
    """(m, 3, 3) corners of the triangles."""
    vertices, faces = joined(contents)
    return vertices[faces]


def box_lines(face: str = "{0} {1} {2}") -> str:
    vertices = "".join(f"v {x!r} {y!r} {z!r}\n" for x, y, z in BOX.vertices.tolist())
    return vertices + "".join("f " + face.format(*row) + "\n" for row in (BOX.faces + 1).tolist())


#: Each gives the square of two triangles.
DIALECTS = {
    # specification: "f v1/vt1/vn1 ...", texture and normal may be absent
    "v": SQUARE + "f 1 2 3\nf 1 3 4\n",
    "v/vt": SQUARE + "vt 0 0\nf 1/1 2/1 3/1\nf 1/1 3/1 4/1\n",
    "v//vn": SQUARE + "vn 0 0 1\nf 1//1 2//1 3//1\nf 1//1 3//1 4//1\n",
    "v/vt/vn": SQUARE + "vt 0 0\nvn 0 0 1\nf 1/1/1 2/1/1 3/1/1\nf 1/1/1 3/1/1 4/1/1\n",
    "mixed": SQUARE + "vt 0 0\nvn 0 0 1\nf 1/1/1 2 3//1\nf 1 3/1 4/\n",
    "quad": SQUARE + "f 1 2 3 4\n",
    # specification: fo is an earlier form of f
    "fo": SQUARE + "fo 1 2 3 4\n",
    # white space of any kind: https://github.com/tinyobjloader/tinyobjloader/issues/140 and others
    "tabs and spaces": "v\t0  0\t0\n  v 1 0 0 \n\tv 1   1 0\nv 0 1 0\t\n\n f  1\t2 3 \n f 1 3 4",
    "CRLF": (SQUARE + "f 1 2 3\nf 1 3 4\n").replace("\n", "\r\n"),
    "CR": (SQUARE + "f 1 2 3\nf 1 3 4\n").replace("\n", "\r"),
    "byte order mark": "\ufeff" + SQUARE + "f 1 2 3\nf 1 3 4\n",
    # MeshLab, ZBrush: colour behind the vertex
    "colours": "v 0 0 0 1 0 0\nv 1 0 0 1 0 0\nv 1 1 0 .5 .5 .5\nv 0 1 0 0 0 0\nf 1 2 3 4\n",
    # specification: w weighs rational curves; polygons do not use it
    "w": "v 0 0 0 1\nv 1 0 0 2.0\nv 1 1 0 0.5\nv 0 1 0\nf 1 2 3 4\n",
    "w and colour": "v 0 0 0 1 9 9 9\nv 1 0 0 1 9 9 9\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n",
    "exponents": "v -0 0.0 -0.0\nv 1e0 0E+00 0e-5\nv +1. 10e-1 0\nv .0 1.0E0 0\nf 1 2 3 4\n",
    "comments": "# v 9 9 9\nv 0 0 0 # first\nv 1 0 0# 7\nv 1 1 0 #\nv 0 1 0\n#\nf 1 2 3 # 4\nf 1 3 4#x\n",
    # https://github.com/mikedh/trimesh/issues/1103 (Rhino)
    "continued lines": "v 0 0 \\\n0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 \\\n3 \\  \n 4\n",
    # https://github.com/assimp/assimp/issues/3532
    "comment that ends with a backslash": "# head\\\n" + SQUARE + "f 1 2 3 4\n",
    # https://github.com/assimp/assimp/issues/2186
    "backslash in a name": SQUARE + "usemtl a\\Solid\\brown\nf 1 2 3 4\n",
    # https://github.com/mikedh/trimesh/pull/2556, https://github.com/CesiumGS/obj2gltf/pull/191
    "relative": SQUARE + "f -4 -3 -2\nf -4 -2 -1\n",
    "relative, interleaved": "v 0 0 0\nv 1 0 0\nv 1 1 0\nf -3 -2 -1\nv 0 1 0\nf -4 -2 -1\n",
    "faces first": "f 1 2 3 4\n" + SQUARE,
    # what exporters write around it; a # in a name is no comment
    "materials and groups": "mtllib a b.mtl\no A#1\n" + SQUARE + "vp 1\ns off\ng a b\nusemtl x\nf 1 2 3 4\n",
}


@pytest.mark.parametrize("dialect", DIALECTS)
def test_each_dialect_gives_the_square(dialect: str) -> None:
    contents = read(DIALECTS[dialect])
    vertices, faces = joined(contents)
    np.testing.assert_array_equal(vertices, CORNERS)
    assert faces.tolist() == HALVES
    assert contents.notes == () and contents.unit is None


def test_utf16_of_powershell_is_read() -> None:
    data = (SQUARE + "f 1 2 3 4\n").encode("utf-16")
    assert detect_format(data, len(data), "a.obj") is Format.OBJ
    np.testing.assert_array_equal(joined(read(data))[0], CORNERS)


def test_a_concave_polygon_keeps_its_area() -> None:
    contents = read("v 0 0 0\nv 4 0 0\nv 4 1 0\nv 1 1 0\nv 1 3 0\nv 0 3 0\nf 1 2 3 4 5 6\n")
    a, b, c = np.moveaxis(corners(contents), 1, 0)
    assert np.cross(b - a, c - a)[:, 2].min() > 0
    np.testing.assert_allclose(np.cross(b - a, c - a)[:, 2].sum() / 2, 6.0)


@pytest.mark.parametrize("face", ["{0} {1} {2}", "{0}/1/1 {1}/1/1 {2}/1/1", "{0}//7 {1}//7 {2}//7"])
def test_the_order_of_vertices_and_faces_is_that_of_the_file(face: str) -> None:
    vertices, faces = joined(read(box_lines(face)))
    np.testing.assert_array_equal(vertices, BOX.vertices)
    np.testing.assert_array_equal(faces, BOX.faces)


@given(st.lists(st.tuples(*[st.floats(-1e12, 1e12)] * 3), min_size=3, max_size=30), st.data())
def test_numbers_are_read_exactly_and_relative_means_absolute(
    points: list[tuple[float, float, float]], data: st.DataObject
) -> None:
    lines, absolute = [], []
    for count, point in enumerate(points, start=1):
        lines.append("v " + " ".join(map(repr, point)))
        if count >= 3:
            face = data.draw(st.lists(st.integers(1, count), min_size=3, max_size=3))
            absolute.append([index - 1 for index in face])
            words = [str(i - count - 1) if data.draw(st.booleans()) else str(i) for i in face]
            lines.append("f " + " ".join(words))
    np.testing.assert_array_equal(corners(read("\n".join(lines))), np.array(points)[np.array(absolute)])


def test_blocks_do_not_change_what_is_read(monkeypatch: pytest.MonkeyPatch) -> None:
    text = DIALECTS["relative, interleaved"] + box_lines("{0}/1 {1} {2}//3")
    whole = joined(read(text))
    monkeypatch.setattr(text_words, "BLOCK", 16)
    for one, two in zip(whole, joined(read(text)), strict=True):
        np.testing.assert_array_equal(one, two)
    with pytest.raises(errors.UnreadableFile, match="line 6 of the obj"):
        read(SQUARE + "f 1 2 3 4\nf 1 2 x\n")


def test_objects_are_bodies_with_their_vertices() -> None:
    text = "o first one\n" + SQUARE + "f 1 2 3 4\no empty\no second\n"
    one, two = read(text + "v 5 5 5\nv 6 5 5\nv 5 6 5\ng x\nf 5 6 7\n").bodies
    assert (one.name, two.name) == ("first one", "second")
    np.testing.assert_array_equal(one.vertices, CORNERS)
    np.testing.assert_array_equal(two.vertices, [(5, 5, 5), (6, 5, 5), (5, 6, 5)])
    assert two.faces.tolist() == [[0, 1, 2]]


def test_objects_that_share_vertices_stay_connected() -> None:
    (body,) = read(SQUARE + "o a\nf 1 2 3\no b\nf 1 3 4\n").bodies
    np.testing.assert_array_equal(body.vertices, CORNERS)
    assert body.faces.tolist() == HALVES


def test_one_object_gives_its_name() -> None:
    assert [body.name for body in read("o part\n" + SQUARE + "f 1 2 3 4\n").bodies] == ["part"]


def test_unused_vertices_are_left_out_with_a_note() -> None:
    contents = read("v 9 9 nan\n" + SQUARE + "v 7 7 7\nf 2 3 4 5\n")
    np.testing.assert_array_equal(joined(contents)[0], CORNERS)
    (note,) = contents.notes
    assert note.code == "left_out_of_obj" and "2 vertices that no face uses" in note.detail


@pytest.mark.parametrize(
    ("statements", "words"),
    [
        ("f 1 2\nf 3\nf\n", "3 faces with fewer than 3 corners"),
        ("l 1 2 3/1\n", "1 line element (l)"),
        ("p 1\np 2 3\n", "2 point statements (p)"),
        ("cstype bspline\ndeg 3\ncurv 0 1 1 2 3\nparm u 0 1\nend\n", "1 curve or surface (curv)"),
        ("sparkle 1\nsparkle 2\n", "2 statements that OBJ does not have (sparkle)"),
    ],
)
def test_what_is_no_surface_is_left_out_with_a_note(statements: str, words: str) -> None:
    contents = read(SQUARE + "f 1 2 3 4\n" + statements)
    np.testing.assert_array_equal(joined(contents)[0], CORNERS)
    (note,) = contents.notes
    assert note.code == "left_out_of_obj" and words in note.detail


def test_vertices_alone_are_points() -> None:
    (cloud,) = read(SQUARE + "vn 0 0 1\n").bodies
    np.testing.assert_array_equal(cloud.vertices, CORNERS)
    assert len(cloud.faces) == 0


def test_point_elements_choose_the_points() -> None:
    contents = read(SQUARE + "p 4 2\np -3\n")
    np.testing.assert_array_equal(joined(contents)[0], CORNERS[[1, 3]])
    assert "2 vertices that no point (p) uses" in contents.notes[0].detail


def test_decimal_commas_are_read_where_they_are_clear() -> None:
    # https://github.com/Perfare/AssetStudio/issues/73
    contents = read("v 0,0 0 0 # a, b\nv 1,5 0,0 0\nv 1,5 -2,5e0 0\nf 1 2 3\n")
    np.testing.assert_array_equal(corners(contents)[0], [(0, 0, 0), (1.5, 0, 0), (1.5, -2.5, 0)])
    (note,) = contents.notes
    assert note.code == "decimal_comma" and "3 vertices" in note.detail


REFUSED = {
    # https://github.com/Dezinater/osrscachereader/pull/16
    "commas between numbers": ("v 0 0 0\nv 1.0, 2.0, 3.0\n", errors.UnreadableFile, "line 2 .* commas"),
    "commas only": ("v 0,0,0\n", errors.UnreadableFile, "line 1 .* commas"),
    # https://github.com/microsoft/DirectXMesh/issues/63
    "thousands": (SQUARE + "f 1 2 1,003\n", errors.UnreadableFile, "line 5 .*'1,003' is no corner"),
    "word": ("v 0 0 0\nv 1 two 0\n", errors.UnreadableFile, "line 2 of the obj has 'two'"),
    "Fortran": ("v 0 0 0\nv 1D+00 2 0\n", errors.UnreadableFile, r"line 2 of the obj has '1D\+00'"),
    "two points": ("v 0 0 0\nv 1.5.2 2 0\n", errors.UnreadableFile, r"'1\.5\.2'"),
    "two coordinates": ("v 0 0 0\nv 1 2\n", errors.UnreadableFile, "line 2 of the obj has 2 coordinates"),
    "index 0": (SQUARE + "f 0 1 2\n", errors.IndexOutOfRange, "line 5 of the obj: .* vertex 0"),
    "index beyond": ("f 1 2 5\n" + SQUARE, errors.IndexOutOfRange, "line 1 .* vertex 5, but there are 4"),
    "too far back": ("v 0 0 0\nf -1 -2 -1\nv 1 1 1\n", errors.IndexOutOfRange, "line 2 .* vertex -2.*only 1"),
    "index with a point": (SQUARE + "f 1 2 3.0\n", errors.UnreadableFile, r"line 5 .*'3\.0'"),
    "index of 30 digits": (SQUARE + f"f 1 2 {'9' * 30}\n", errors.UnreadableFile, "line 5"),
    "index missing": (SQUARE + "f 1 2 /3\n", errors.UnreadableFile, "line 5 .*'/3'"),
    "after a continued line": (SQUARE + "f 1 2 \\\n3\nf 1 2 x\n", errors.UnreadableFile, "line 7 .*'x'"),
    "damaged keyword": ("v 0 0 0\nv1 0 0\n", errors.UnreadableFile, "line 2 of the obj starts with 'v1'"),
    "zeros at the end": (SQUARE.encode() + b"\0" * 40, errors.UnreadableFile, "line 5"),
    "lines only": (SQUARE + "l 1 2\nl 2 3\n", errors.UnreadableFile, "no faces .*2 of l"),
    "surfaces only": (SQUARE + "surf 0 1 0 1 1 2 3 4\nend\n", errors.UnreadableFile, "1 of surf"),
    "edges only": (SQUARE + "f 1 2\n", errors.UnreadableFile, "fewer than 3 corners"),
    "no vertices": ("o part\ng x\n", errors.UnreadableFile, "no vertices"),
    "another file": (SQUARE + "call other.obj\n", errors.UnreadableFile, "line 5 .*call"),
    "NaN": (SQUARE + "v nan 0 0\nf 1 2 5\n", errors.NotFinite, "1 of 5 vertices .* line 5"),
    "overflow": (SQUARE + "v 1e400 0 0\nf 1 2 5\n", errors.NotFinite, "line 5"),
    "far polygon": (SQUARE + "v 1e200 0 0\nf 1 2 5 4\n", errors.CoordinateOutOfRange, "1e.200"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_a_bad_file_is_refused_with_its_line(case: str) -> None:
    text, error, words = REFUSED[case]
    with pytest.raises(error, match=words) as caught:
        read(text)
    assert len(caught.value.remedy) > 10


def test_sizes_beyond_the_limits_are_refused() -> None:
    with pytest.raises(errors.MeshTooLarge, match="more than 3 vertices"):
        read(SQUARE + "f 1 2 3 4\n", max_points=3, max_faces=1)
    with pytest.raises(errors.MeshTooLarge, match="1 triangles and 4 vertices"):
        read(SQUARE + "f 1 2 3\n", max_points=3)
    with pytest.raises(errors.MeshTooLarge, match="2 triangles and 4 vertices; the limits are 1"):
        read(SQUARE + "f 1 2 3 4\n", max_faces=1)
