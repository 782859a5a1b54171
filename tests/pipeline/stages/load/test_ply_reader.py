"""Every dialect of PLY gives the surface that its writer meant, or is refused with element, row and line."""

import re
import struct
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline import Format, detect_format
from pipeline.core import errors
from pipeline.core.mesh import FloatArray
from pipeline.core.settings import LoadSettings
from pipeline.stages.load.contents import Contents
from pipeline.stages.load.ply import read_ply
from pipeline.stages.load.ply_header import ENCODINGS, TYPES
from tests.support import shapes

SETTINGS = LoadSettings()
BALL = shapes.icosphere(10.0, 1)
#: A square from the origin, of two triangles.
POINTS = [(0, 0, 0), (2, 0, 0), (2, 2, 0), (0, 2, 0)]
TRIANGLES = [[0, 1, 2], [0, 2, 3]]
CODES = {
    "i1": "b",
    "u1": "B",
    "i2": "h",
    "u2": "H",
    "i4": "i",
    "u4": "I",
    "i8": "q",
    "u8": "Q",
    "f4": "f",
    "f8": "d",
}
XYZ = ["float x", "float y", "float z"]
FACE = ["list uchar int vertex_indices"]
Row = list[Any]


def ply(
    elements: list[tuple[str, list[str], list[Row]]],
    encoding: str = "ascii",
    header: str = "",
    end: str = "\n",
    announced: dict[str, int] | None = None,
) -> bytes:
    """A file of elements: name, properties as in the header, and rows, in which a list is a list."""
    head = [f"ply{end}format {encoding} 1.0{end}{header}"]
    body = b""
    for name, properties, rows in elements:
        head.append(f"element {name} {(announced or {}).get(name, len(rows))}{end}")
        head += [f"property {each}{end}" for each in properties]
        body += b"".join(row_bytes(row, properties, encoding, end) for row in rows)
    return "".join([*head, f"end_header{end}"]).encode() + body


def row_bytes(row: Row, properties: list[str], encoding: str, end: str) -> bytes:
    if encoding == "ascii":
        flat = [x for each in row for x in ([len(each), *each] if isinstance(each, list) else [each])]
        return (" ".join(str(x) for x in flat) + end).encode()
    order, out = ENCODINGS[encoding], b""
    for value, words in zip(row, (each.split() for each in properties), strict=True):
        if words[0] == "list":
            out += struct.pack(order + CODES[TYPES[words[1]]], len(value))
            out += struct.pack(f"{order}{len(value)}{CODES[TYPES[words[2]]]}", *value)
        else:
            out += struct.pack(order + CODES[TYPES[words[0]]], value)
    return out


def vertices(rows: Any = POINTS) -> tuple[str, list[str], list[Row]]:
    return ("vertex", XYZ, [list(row) for row in rows])


def faces(rows: Any = TRIANGLES, properties: list[str] = FACE) -> tuple[str, list[str], list[Row]]:
    return ("face", properties, [[list(row)] for row in rows])


def read(data: bytes) -> Contents:
    """Through the look at the upload, as the service does."""
    assert detect_format(data[:4096], len(data), "part.ply") is Format.PLY
    return read_ply(data, SETTINGS)


def area(contents: Contents) -> FloatArray:
    """(3,) sum of the area vectors: orientation counts."""
    body = contents.bodies[0]
    a, b, c = (body.vertices[body.faces[:, k]] for k in range(3))
    return np.asarray(np.cross(b - a, c - a).sum(axis=0) / 2)


def codes(contents: Contents) -> list[str]:
    return [note.code for note in contents.notes]


EACH_ENCODING = pytest.mark.parametrize("encoding", ENCODINGS)
Elements = list[tuple[str, list[str], list[Row]]]
DIALECTS: dict[str, Elements] = {
    "triangles (all)": [vertices(), faces()],
    "a quad (Blender)": [vertices(), faces([[0, 1, 2, 3]])],
    "triangles and quads (Blender)": [
        vertices([*POINTS, (4, 0, 0), (4, 2, 0)]),
        faces([[0, 1, 2], [0, 2, 3]]),
    ],
    "a polygon (MeshLab)": [vertices([(0, 0, 0), (1, 0, 0), *POINTS[1:]]), faces([[0, 1, 2, 3, 4]])],
    "polygons of three lengths": [
        vertices([(0, 0, 0), (1, 0, 0), *POINTS[1:], (1, 2, 0)]),
        faces([[0, 1, 5], [1, 2, 3, 5], [4, 0, 5]]),
    ],
    "vertex_index (Assimp, PCL)": [vertices(), faces(properties=["list uchar int vertex_index"])],
    "uint counts (VTK of large cells)": [vertices(), faces(properties=["list uint uint vertex_indices"])],
    "unequal faces with int counts": [
        vertices([*POINTS, (1, 1, 0)]),
        faces([[0, 1, 4], [1, 2, 3, 4], [3, 0, 4]], ["list int32 int16 vertex_indices"]),
    ],
    "sized type names (MeshIO, Open3D)": [
        ("vertex", ["float64 x", "float64 y", "float64 z"], [list(row) for row in POINTS]),
        faces(properties=["list uint8 int64 vertex_indices"]),
    ],
    "int coordinates": [("vertex", ["int x", "short y", "uchar z"], [list(row) for row in POINTS]), faces()],
    "coordinates among others, in another order (3D scanners)": [
        (
            "vertex",
            ["uchar red", "float z", "double nx", "float x", "ushort quality", "float y"],
            [[7, z, 0.5, x, 9, y] for x, y, z in POINTS],
        ),
        faces(),
    ],
    "upper case names": [
        ("vertex", ["float X", "float Y", "float Z"], [list(row) for row in POINTS]),
        faces(),
    ],
    "a list at each vertex": [
        ("vertex", ["list uchar float weights", *XYZ], [[[0.5] * k, *row] for k, row in enumerate(POINTS)]),
        faces(),
    ],
    "faces with scalars and texture coordinates (MeshLab)": [
        vertices(),
        (
            "face",
            ["uchar flags", *FACE, "list uchar float texcoord", "int texnumber"],
            [[1, [0, 1, 2], [0.25] * 6, -1], [2, [0, 2, 3], [0.5] * 6, 0]],
        ),
    ],
    "faces of unequal length with texture coordinates": [
        vertices([*POINTS, (1, 1, 0)]),
        (
            "face",
            ["list uchar float texcoord", *FACE, "uchar red"],
            [[[], [0, 1, 4], 1], [[0.5] * 8, [1, 2, 3, 4], 2], [[0.5], [3, 0, 4], 3]],
        ),
    ],
    "strips (Stanford)": [
        vertices([*POINTS[:2], POINTS[3], POINTS[2]]),
        ("tristrips", FACE, [[[0, 1, 2, 3]]]),
    ],
    "strips with restarts": [
        vertices(),
        ("tristrips", ["list int int vertex_indices"], [[[0, 1, 2, -1, 0, 2, 3, -1]], [[]]]),
    ],
    "strips with repeated corners": [vertices(), ("tristrips", FACE, [[[0, 0, 3, 1, 2, 2]]])],
}


@EACH_ENCODING
@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"], ids=["LF", "CRLF", "CR"])
@pytest.mark.parametrize("dialect", DIALECTS)
def test_a_dialect_has_the_square_of_area_4(dialect: str, end: str, encoding: str) -> None:
    contents = read(ply(DIALECTS[dialect], encoding, end=end))
    np.testing.assert_allclose(area(contents), (0, 0, 4), atol=1e-12)
    used = contents.bodies[0].vertices[np.unique(contents.bodies[0].faces)]
    np.testing.assert_array_equal([used.min(axis=0), used.max(axis=0)], [(0, 0, 0), (2, 2, 0)])
    assert contents.notes == ()


@EACH_ENCODING
def test_other_elements_are_stepped_over_and_named(encoding: str) -> None:
    """edge (CloudCompare), material (Turk), camera (PCL, VCG), user elements; before, between and after."""
    data = ply(
        [
            ("camera", ["float view_px", "list uchar int ids"], [[1.0, [4, 5]]]),
            vertices(),
            ("edge", ["int vertex1", "int vertex2"], [[0, 1], [1, 2]]),
            faces(),
            ("material", ["list uchar uchar name"], [[[65] * k] for k in range(3)]),
            ("nothing", [], []),
        ],
        encoding,
        "comment made by hand\ncomment TextureFile end_header.png\nobj_info num_cols 3\n\n",
    )
    contents = read(data)
    np.testing.assert_allclose(area(contents), (0, 0, 4))
    assert codes(contents) == ["other_elements"]
    assert "1 camera, 2 edge, 3 material" in contents.notes[0].detail


@EACH_ENCODING
def test_points_without_faces_are_a_cloud(encoding: str) -> None:
    for elements in ([vertices()], [vertices(), faces([])], [vertices(), ("face", [], [])]):
        body = read(ply(elements, encoding)).bodies[0]
        np.testing.assert_array_equal(body.vertices, POINTS)
        assert len(body.faces) == 0


@EACH_ENCODING
def test_points_without_position_are_left_out_and_counted(encoding: str) -> None:
    """Organised clouds (PCL, Zivid, Photoneo) have NaN where the scanner saw nothing."""
    rows = [(float("nan"), 0, 0), *POINTS, (0, float("inf"), 0)]
    contents = read(ply([vertices(rows)], encoding))
    np.testing.assert_array_equal(contents.bodies[0].vertices, POINTS)
    assert codes(contents) == ["points_without_position"] and "2 of 6 points" in contents.notes[0].detail
    shifted = [[i + 1 for i in row] for row in TRIANGLES]
    np.testing.assert_allclose(area(read(ply([vertices(rows), faces(shifted)], encoding))), (0, 0, 4))
    used = read(ply([vertices(rows), faces([[0, 1, 2, 3]])], encoding)).bodies[0]
    assert not np.isfinite(used.vertices[used.faces]).all()  # the mesh reports it
    with pytest.raises(errors.NotFinite, match="all 1 points"):
        read(ply([vertices(rows[:1])], encoding))


def test_words_of_microsoft_for_nan_are_read() -> None:
    rows = [("1.#QNAN", "-1.#IND000", 0), *POINTS, ("-nan(ind)", 0, 0)]
    assert len(read(ply([vertices(rows)])).bodies[0].vertices) == 4


def grid(columns: int, rows: int, height: Callable[[int, int], float]) -> Elements:
    points = [(x, y, height(x, y)) for y in range(rows) for x in range(columns)]
    return [vertices(points), ("range_grid", FACE, [[[i]] for i in range(len(points))])]


SIZE = "obj_info num_cols {}\nobj_info num_rows {}\n"


@EACH_ENCODING
def test_a_range_grid_is_triangulated_to_its_outline(encoding: str) -> None:
    """Range scans of Stanford's repository; orientation as trimesh2 has it."""
    elements = grid(4, 3, lambda x, y: 5.0)
    contents = read(ply(elements, encoding, SIZE.format(4, 3)))
    np.testing.assert_allclose(area(contents), (0, 0, 6))
    assert codes(contents) == ["range_grid"] and "12 triangles" in contents.notes[0].detail
    elements[1][2][0] = [[]]  # a corner of the grid without a point
    np.testing.assert_allclose(area(read(ply(elements, encoding, SIZE.format(4, 3)))), (0, 0, 5.5))


def test_a_range_grid_ends_at_a_depth_jump() -> None:
    contents = read(ply(grid(6, 4, lambda x, y: 5.0 if x < 3 else 50.0), header=SIZE.format(6, 4)))
    np.testing.assert_allclose(area(contents), (0, 0, 12))  # 2 by 3 on either side
    assert "6 triangles with an edge" in contents.notes[0].detail


def test_a_cell_of_a_range_grid_is_cut_at_the_shorter_diagonal() -> None:
    body = read(ply(grid(2, 2, lambda x, y: 4.0 if x < y else 1.0), header=SIZE.format(2, 2))).bodies[0]
    shared = set(body.faces[0]) & set(body.faces[1])
    assert shared == {0, 3}
    body = read(ply(grid(2, 2, lambda x, y: 3.0 * x * y + 1), header=SIZE.format(2, 2))).bodies[0]
    assert set(body.faces[0]) & set(body.faces[1]) == {1, 2}


@pytest.mark.parametrize("header", ["", SIZE.format(5, 5), "obj_info num_cols x\n"])
def test_a_range_grid_without_its_size_is_a_cloud_with_a_note(header: str) -> None:
    contents = read(ply(grid(4, 3, lambda x, y: 5.0), header=header))
    assert len(contents.bodies[0].faces) == 0 and len(contents.bodies[0].vertices) == 12
    assert codes(contents) == ["range_grid"]


def test_gaussian_splats_are_points_with_a_note() -> None:
    names = ["float f_dc_0", "float opacity", "float scale_0", "float rot_0"]
    contents = read(ply([("vertex", [*XYZ, *names], [[*row, 1, 1, 1, 1] for row in POINTS])]))
    assert codes(contents) == ["gaussian_splats"] and len(contents.bodies[0].vertices) == 4


def test_text_in_other_forms_is_read() -> None:
    data = ply([vertices(), faces()])
    wrapped = data.replace(b"\n3 0", b"\n\n3\n 0").replace(b"0 0 0\n2 0 0", b"0 0 0 2\t0 0")
    assert wrapped != data
    utf16 = data.decode().encode("utf-16")  # redirection in PowerShell
    for each in (
        wrapped,
        utf16,
        b"\xef\xbb\xbf" + data,
        data + b"\n\nthe end\n",
        data.replace(b"1.0", b"1.1"),
    ):
        contents = read(each)
        np.testing.assert_allclose(area(contents), (0, 0, 4))
        assert contents.notes == ()
    half = ply([vertices(np.array(POINTS) + 0.5), faces()]).replace(b".5", b",5").replace(b" 1.0", b" 1.0")
    assert codes(read(half)) == ["decimal_comma"]  # Assimp issue 750
    assert read(half).bodies[0].vertices.min() == 0.5


@EACH_ENCODING
def test_bytes_after_the_data_are_accepted(encoding: str) -> None:
    np.testing.assert_allclose(area(read(ply([vertices(), faces()], encoding) + b"\0\1\2" * 50)), (0, 0, 4))


def test_faces_without_area_are_counted() -> None:
    contents = read(ply([vertices(), faces([*TRIANGLES, [0, 1], []])]))
    assert codes(contents) == ["faces_without_area"] and "2 of 4 faces" in contents.notes[0].detail


WHOLE = ply([vertices(), faces()]).decode()
REFUSED: dict[str, tuple[str, type[errors.PipelineError], str]] = {
    "no end_header": (WHOLE.split("end_header")[0], errors.TruncatedFile, "8 lines, and no end_header"),
    "unknown word": (
        WHOLE.replace("element face", "elements face"),
        errors.UnreadableFile,
        "line 7 .*'elements",
    ),
    "unknown type": (WHOLE.replace("float y", "real y"), errors.UnreadableFile, "line 5 .*'real y'"),
    "counts of float": (WHOLE.replace("list uchar", "list float"), errors.UnreadableFile, "line 8 .* float"),
    "negative count": (WHOLE.replace("vertex 4", "vertex -4"), errors.UnreadableFile, "line 3"),
    "property before element": (
        WHOLE.replace("element", "property int a\nelement", 1),
        errors.UnreadableFile,
        "line 3",
    ),
    "version 2": (WHOLE.replace("1.0", "2.0"), errors.UnreadableFile, "line 2 .*'2.0'"),
    "unknown format": (WHOLE.replace("ascii", "binary"), errors.UnreadableFile, "line 2 .*'binary 1.0'"),
    "no format": (WHOLE.replace("format", "comment"), errors.UnreadableFile, "format line"),
    "element twice": (WHOLE.replace("face 2", "vertex 2"), errors.UnreadableFile, "line 7"),
    "no z": (WHOLE.replace("float z", "float w"), errors.UnreadableFile, "x, y, w"),
    "no vertices": (WHOLE.replace("element vertex", "element point"), errors.UnreadableFile, "point, face"),
    "no corners": (WHOLE.replace("vertex_indices", "material"), errors.UnreadableFile, "material"),
    "short row": (WHOLE.replace("2 0 0\n", "2 0\n", 1), errors.UnreadableFile, "line 11 .* row 1 of vertex"),
    "long row": (WHOLE.replace("2 0 0\n", "2 0 0 9\n", 1), errors.UnreadableFile, "line 11 .* 4 values"),
    "short list": (WHOLE.replace("3 0 1 2", "3 0 1"), errors.UnreadableFile, "line 14 .* row 0 of face"),
    "long list": (WHOLE.replace("3 0 1 2", "3 0 1 2 3"), errors.UnreadableFile, "line 14 .* row 0 of face"),
    "negative list": (WHOLE.replace("3 0 1 2", "-3 0 1 2"), errors.UnreadableFile, "line 14"),
    "a word": (WHOLE.replace("2 0 0\n", "2 zero 0\n", 1), errors.UnreadableFile, "line 11 .*'zero'"),
    "broken index": (WHOLE.replace("3 0 1 2", "3 0 1 1.5"), errors.UnreadableFile, "row 0 of face .* 1.5"),
    "index too large": (
        WHOLE.replace("3 0 2 3", "3 0 2 4"),
        errors.IndexOutOfRange,
        "row 1 of face .* vertex 4",
    ),
    "negative index": (
        WHOLE.replace("3 0 2 3", "3 0 2 -1"),
        errors.IndexOutOfRange,
        "row 1 of face .* vertex -1",
    ),
    "cut rows": (WHOLE[: WHOLE.index("2 2 0")], errors.TruncatedFile, "announces 4 vertex rows and has 2"),
    "cut in a row": (WHOLE[:-4], errors.TruncatedFile, "2 face rows and has 1: line 15"),
    "huge counts": (WHOLE.replace("vertex 4", "vertex 99999999999"), errors.PipelineError, "vertex"),
    "commas and points": (
        WHOLE.replace("2 0 0\n", "2,5 0.5 0\n", 1),
        errors.UnreadableFile,
        "line 11 .* comma",
    ),
}


@pytest.mark.parametrize("case", REFUSED)
def test_a_broken_file_is_refused_with_its_place(case: str) -> None:
    written, expected, words = REFUSED[case]
    for end in ("\n", "\r\n", "\r"):
        with pytest.raises(expected, match=words):
            read(written.replace("\n", end).encode())


@pytest.mark.parametrize("encoding", ["binary_little_endian", "binary_big_endian"])
def test_a_cut_binary_file_says_what_is_missing(encoding: str) -> None:
    for rows in (TRIANGLES, [[0, 1, 2, 3], [0, 1, 2]]):
        data = ply([vertices(), faces(rows)], encoding)
        with pytest.raises(errors.TruncatedFile, match="2 face rows and has 1: row 1"):
            read(data[:-1])
        with pytest.raises(errors.TruncatedFile, match="4 vertex rows and has 3: row 3"):
            read(data[: data.index(b"end_header\n") + 11 + 40])
    many = {"vertex": 10**15, "face": 10**15}
    for element in many:
        data = ply([vertices(), faces()], encoding, announced={element: many[element]})
        with pytest.raises(errors.TruncatedFile, match=f"{10**15} {element} rows"):
            read(data)


@pytest.mark.parametrize("element", ["face", "tristrips"])
def test_lists_that_break_programs_are_refused(element: str) -> None:
    for count in ("char", "int", "int64", "uint64", "uint"):
        properties = [f"list {count} int vertex_indices"]
        data = ply([vertices(), (element, properties, [[[0, 1, 2]], [[0, 2, 3]]])], "binary_little_endian")
        at = len(data) - 12 - np.dtype(TYPES[count]).itemsize
        broken = data[:at] + b"\xff" * (len(data) - 12 - at) + data[-12:]
        with pytest.raises((errors.UnreadableFile, errors.TruncatedFile), match=r"row 1|has 1"):
            read(broken)


def test_too_many_rows_are_refused_before_they_are_read() -> None:
    one = ply([vertices(), faces(TRIANGLES[:1])], "binary_little_endian")
    with pytest.raises(errors.MeshTooLarge, match="4 vertices; the limit is 3"):
        read_ply(one, LoadSettings(max_points=3))
    data = ply([vertices(), faces()], "binary_little_endian")
    with pytest.raises(errors.MeshTooLarge, match="2 faces; the limit is 1"):
        read_ply(data, LoadSettings(max_faces=1))
    with pytest.raises(errors.MeshTooLarge, match="2 triangles; the limit is 1"):
        read_ply(ply([vertices(), faces([[0, 1, 2, 3]])]), LoadSettings(max_faces=1))


@pytest.mark.timeout(60)
def test_a_hostile_header_takes_time_in_proportion() -> None:
    for line in (b"element a%d 0\n", b"property float a%d\n"):
        lines = b"".join(line % k for k in range(200_000))
        with pytest.raises(errors.UnreadableFile, match="more than 10000"):
            read(b"ply\nformat ascii 1.0\nelement vertex 1\n" + lines + b"end_header\n")
    data = ply(
        [vertices(), ("tristrips", ["list uint int vertex_indices"], [[[0, 1, 2] * 100_000]])],
        "binary_big_endian",
    )
    assert len(read(data).bodies[0].faces) == 299_998


@given(data=st.data())
def test_any_header_gives_the_same_numbers(data: st.DataObject) -> None:
    """Elements, properties, types and byte orders by chance; the numbers fit in every type."""
    draw = data.draw
    types, integers = (
        st.sampled_from(list(TYPES)),
        st.sampled_from([name for name in TYPES if TYPES[name][0] != "f"]),
    )
    numbers = st.integers(0, 100)

    def extra(number: int) -> str:
        item = draw(types)
        return f"list {draw(integers)} {item} e{number}" if draw(st.booleans()) else f"{item} e{number}"

    def element(name: str, own: list[str], values: list[Row]) -> tuple[str, list[str], list[Row]]:
        properties = draw(st.permutations([*own, *(extra(k) for k in range(draw(st.integers(0, 3))))]))
        rows = [
            [
                row[own.index(each)]
                if each in own
                else draw(st.lists(numbers, max_size=3))
                if each.startswith("list")
                else draw(numbers)
                for each in properties
            ]
            for row in values
        ]
        return name, list(properties), rows

    n = draw(st.integers(3, 6))
    points = [draw(st.tuples(numbers, numbers, numbers)) for _ in range(n)]
    triangles = draw(st.lists(st.permutations(range(n)).map(lambda order: list(order[:3])), max_size=5))
    made = [
        element("vertex", [f"{draw(types)} {name}" for name in "xyz"], [list(each) for each in points]),
        element(
            "face", [f"list {draw(integers)} {draw(types)} vertex_indices"], [[each] for each in triangles]
        ),
        element("other", [], [[] for _ in range(draw(st.integers(0, 2)))]),
    ]
    made = [each for each in draw(st.permutations(made)) if each[1]]
    contents = read(
        ply(made, draw(st.sampled_from(list(ENCODINGS))), end=draw(st.sampled_from(["\n", "\r\n"])))
    )
    np.testing.assert_array_equal(contents.bodies[0].vertices, points)
    np.testing.assert_array_equal(contents.bodies[0].faces, np.array(triangles, dtype=int).reshape(-1, 3))


BROKEN = [
    ply(elements, encoding, SIZE.format(4, 3))
    for elements in (DIALECTS["faces of unequal length with texture coordinates"], grid(4, 3, lambda x, y: x))
    for encoding in ENCODINGS
]


@given(
    st.sampled_from(BROKEN),
    st.integers(0, 500),
    st.sampled_from([b"", b"\xff" * 4, b"\0", b"nan ", b"1e308 ", b"-1 ", b"\n", b"end_header\n"]),
    st.integers(0, 8),
)
def test_a_changed_file_is_read_or_refused(whole: bytes, at: int, evil: bytes, lost: int) -> None:
    try:
        read_ply(whole[:at] + evil + whole[at + lost :], SETTINGS)
    except errors.PipelineError as refused:
        assert refused.reason and refused.remedy
        assert not re.search(r"(design|scan|mesh):", refused.reason)
