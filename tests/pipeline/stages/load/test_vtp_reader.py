"""A VTP is read in every layout of VTK XML, or refused with the array and what is wrong.

Dialects are named with their public source; the files are made by `tests.support.vtp_files`.
"""

from itertools import product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.core import errors
from pipeline.core.formats import Format, detect_format
from pipeline.core.settings import LoadSettings
from pipeline.stages.load.contents import Contents, joined
from pipeline.stages.load.parts import choose_part
from pipeline.stages.load.vtp import read_vtp
from tests.support import shapes
from tests.support.vtp_files import Layout

BALL = shapes.icosphere(10.0, 1)
SQUARE = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
ZLIB, LZMA = "vtkZLibDataCompressor", "vtkLZMADataCompressor"
LAYOUTS = [Layout(), Layout(points="f8", indices="i4")]
LAYOUTS += [
    Layout(shape, encoding, order, header, compressor, joined=one, points=points)
    for (shape, encoding), order, header, compressor, (one, points) in product(
        [("binary", "base64"), ("appended", "base64"), ("appended", "raw")],
        "<>",
        ["u4", "u8"],
        ["", ZLIB, LZMA],
        [(False, "f4"), (True, "f8")],
    )
    if not (one and compressor)
]


def read(data: bytes, **limits: int) -> Contents:
    return read_vtp(data, LoadSettings(**limits))


def fresh(layout: Layout) -> Layout:
    layout.appended = b""
    return layout


@pytest.mark.parametrize("layout", LAYOUTS, ids=str)
def test_every_layout_gives_the_same_mesh(layout: Layout) -> None:
    layout = fresh(layout)
    data = layout.file(layout.piece(BALL.vertices, Verts=[], Lines=[], Strips=[], Polys=BALL.faces.tolist()))
    assert detect_format(data[:4096], len(data)) == Format.VTP
    contents = read(data)
    vertices, faces = joined(contents)
    np.testing.assert_allclose(vertices, BALL.vertices, rtol=0 if layout.points == "f8" else 1e-6, atol=1e-9)
    np.testing.assert_array_equal(faces, BALL.faces)
    assert contents.unit is None and contents.notes == ()


def test_polygons_strips_and_pieces_are_triangles() -> None:
    made = Layout()
    data = made.file(
        made.piece(SQUARE, Polys=[[0, 1, 2, 3]]),
        made.piece(SQUARE, Strips=[[0, 1, 3, 2]]),
        made.piece([]),
    )
    contents = read(data)
    assert choose_part(contents, None).notes == ()  # pieces are no parts
    assert [len(body.vertices) for body in contents.bodies] == [4, 4]
    assert contents.bodies[0].faces.tolist() == [[0, 1, 2], [0, 2, 3]]
    assert contents.bodies[1].faces.tolist() == [[0, 1, 3], [3, 1, 2]]


def test_a_concave_polygon_keeps_its_area() -> None:
    made = Layout()
    points = np.array([[0, 0, 0], [4, 0, 0], [4, 3, 0], [2, 1, 0], [0, 3, 0]], dtype=float)
    vertices, faces = joined(read(made.file(made.piece(points, Polys=[[0, 1, 2, 3, 4]]))))
    cross = np.cross(
        vertices[faces[:, 1]] - vertices[faces[:, 0]], vertices[faces[:, 2]] - vertices[faces[:, 0]]
    )
    assert (cross[:, 2] > 0).all() and cross[:, 2].sum() / 2 == pytest.approx(8.0)


def test_points_alone_are_a_cloud() -> None:
    made = Layout("binary")
    for data in (made.file(made.piece(SQUARE, Verts=[[0, 1, 2, 3]])), made.file(made.piece(SQUARE))):
        vertices, faces = joined(read(data))
        assert vertices.tolist() == SQUARE and not len(faces)


def test_what_has_no_area_is_left_out_and_said() -> None:
    made = Layout()
    data = made.file(
        made.piece(SQUARE, Lines=[[0, 1], [1, 2]], Polys=[[0, 1, 2], [0, 1]]), made.piece(SQUARE)
    )
    contents = read(data)
    assert [note.code for note in contents.notes] == ["left_out_of_vtp"]
    assert "2 lines, 1 polygons with fewer than 3 corners, 4 points" in contents.notes[0].detail
    with pytest.raises(errors.UnreadableFile, match="no triangles and no points, and 1 lines"):
        read(made.file(made.piece(SQUARE, Lines=[[0, 1]])))


def test_other_data_are_stepped_over() -> None:
    made = Layout("appended", "raw")
    piece = made.piece(SQUARE, Polys=[[0, 1, 2]])
    extra = b"<PointData>" + made.array("weight", [1, 2, 3, 4]) + b"</PointData>\n</Piece>"
    assert len(joined(read(made.file(piece.replace(b"</Piece>", extra))))[1]) == 1


def test_raw_data_that_look_like_xml_are_read() -> None:
    # https://github.com/nschloe/meshio/issues/483: raw bytes are no XML
    made = Layout("appended", "raw", points="f8")
    points = np.frombuffer(b"<a/>]]>&b;_ <DataArray>\0\xff ", dtype="<f8", count=3).reshape(1, 3)
    points = np.vstack([points, SQUARE])
    assert read(made.file(made.piece(points))).bodies[0].vertices[0].tolist() == points[0].tolist()


@pytest.mark.parametrize("kind", ["UnstructuredGrid", "PPolyData", "ImageData"])
def test_other_kinds_of_vtk_files_are_refused_by_name(kind: str) -> None:
    with pytest.raises(errors.UnreadableFile, match=f"of type {kind}"):
        read(Layout().file(kind=kind))


def test_an_unknown_compressor_is_refused_by_name() -> None:
    made = Layout("binary", compressor=ZLIB)
    data = made.file(made.piece(SQUARE)).replace(ZLIB.encode(), b"vtkLZ4DataCompressor")
    with pytest.raises(errors.UnreadableFile, match="compressed by vtkLZ4DataCompressor"):
        read(data)


def test_a_bomb_is_refused_before_it_unpacks() -> None:
    made = Layout("binary", compressor=ZLIB, block=2**22)
    data = made.file(made.piece(np.zeros((600_000, 3))))
    with pytest.raises(errors.MeshTooLarge, match="the limit is 10 times the size"):
        read(data, max_archive_expansion=10)


@pytest.mark.parametrize(
    "layout", [Layout(), Layout("binary"), Layout("appended"), Layout("appended", "raw")], ids=str
)
@pytest.mark.parametrize("share", [0.3, 0.6, 0.95])
def test_a_cut_file_is_said_to_be_cut(layout: Layout, share: float) -> None:
    layout = fresh(layout)
    data = layout.file(layout.piece(BALL.vertices, Polys=BALL.faces.tolist()))
    with pytest.raises(errors.TruncatedFile):
        read(data[: int(share * len(data))])


@pytest.mark.parametrize(
    ("old", "new", "kind", "reason"),
    [
        (b'NumberOfPoints="4"', b'NumberOfPoints="5"', errors.UnreadableFile, "announces 5 points"),
        (b'NumberOfPolys="1"', b'NumberOfPolys="2"', errors.UnreadableFile, "announces 2 polys, and has 1"),
        (b"0 1 2 3", b"0 1 2 9", errors.IndexOutOfRange, "poly 0 .* refers to point 9, but there are 4"),
        (b"0 1 2 3", b"0 1 2 -1", errors.IndexOutOfRange, "refers to point -1"),
        (b"0 1 2 3", b"0 1 2", errors.UnreadableFile, "do not fit their corners"),
        (b"0 1 2 3", b"0 1 x 3", errors.UnreadableFile, "a word that is no number"),
        (b'Name="offsets"', b'Name="of"', errors.UnreadableFile, "no connectivity and offsets"),
        (b'type="Float32"', b'type="Bit"', errors.UnreadableFile, "type Bit"),
        (b'format="ascii"', b'format="hex"', errors.UnreadableFile, "format 'hex'"),
        (b"LittleEndian", b"MiddleEndian", errors.UnreadableFile, "byte_order 'MiddleEndian'"),
        (b"<Points>", b"<!DOCTYPE a>", errors.UnreadableFile, "document type"),
        (b"</Points>", b"</Pints>", errors.UnreadableFile, "not well-formed"),
        (b'Components="3"', b'Components="2"', errors.UnreadableFile, "have 2 numbers"),
    ],
)
def test_damage_is_named(old: bytes, new: bytes, kind: type[errors.PipelineError], reason: str) -> None:
    made = Layout()
    data = made.file(made.piece(SQUARE, Polys=[[0, 1, 2, 3]]))
    assert old in data
    with pytest.raises(kind, match=reason):
        read(data.replace(old, new))


def test_an_offset_beyond_the_data_is_refused() -> None:
    made = Layout("appended", "raw")
    data = made.file(made.piece(SQUARE))
    with pytest.raises(errors.UnreadableFile, match="start at byte 99999"):
        read(data.replace(b'offset="0"', b'offset="99999"'))


def test_too_many_are_refused() -> None:
    made = Layout()
    data = made.file(made.piece(BALL.vertices, Polys=BALL.faces.tolist()))
    with pytest.raises(errors.MeshTooLarge):
        read(data, max_faces=10)


BROKEN = [
    fresh(layout).file(layout.piece(SQUARE, Polys=[[0, 1, 2, 3]], Strips=[[0, 1, 2]]))
    for layout in (
        LAYOUTS[0],
        Layout("binary", compressor=ZLIB),
        Layout("appended"),
        Layout("appended", "raw"),
    )
]


@given(
    st.sampled_from(BROKEN),
    st.integers(0, 2000),
    st.sampled_from([b"", b"\xff" * 4, b"\0", b"nan", b"1e400", b"-1", b"<", b"99999999999", b"==", b"A"]),
    st.integers(0, 8),
)
def test_a_changed_file_is_read_or_refused(whole: bytes, at: int, evil: bytes, lost: int) -> None:
    try:
        joined(read(whole[:at] + evil + whole[at + lost :]))
    except errors.PipelineError as refused:
        assert refused.reason and refused.remedy
