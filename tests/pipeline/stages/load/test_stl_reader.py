"""Every dialect of STL gives the triangles that its writer meant, or is refused with line or triangle."""

import struct

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline import Format, detect_format
from pipeline.core import errors
from pipeline.core.mesh import FloatArray
from pipeline.core.settings import LoadSettings
from pipeline.stages.load.contents import Contents, joined
from pipeline.stages.load.stl import read_stl
from tests.support import shapes

BALL = shapes.icosphere(10.0, 1)
CORNERS = BALL.vertices[BALL.faces].astype(np.float32).astype(np.float64)
SETTINGS = LoadSettings()


def binary(corners: FloatArray, header: bytes = b"", count: int | None = None, attribute: int = 0) -> bytes:
    facets = np.zeros(len(corners), np.dtype([("n", "<f4", 3), ("v", "<f4", (3, 3)), ("a", "<u2")]))
    facets["v"], facets["a"] = corners, attribute
    announced = len(corners) if count is None else count
    return header[:80].ljust(80, b" ") + struct.pack("<I", announced) + facets.tobytes()


def facet(corners: FloatArray, number: str = "{:.9g}") -> str:
    lines = ["facet normal 0 0 0", "outer loop"]
    lines += ["vertex " + " ".join(number.format(x) for x in corner) for corner in corners]
    return "\n".join([*lines, "endloop", "endfacet"]) + "\n"


def text(corners: FloatArray, name: str = "part", number: str = "{:.9g}") -> str:
    return f"solid {name}\n" + "".join(facet(each, number) for each in corners) + f"endsolid {name}\n"


def read(data: bytes) -> Contents:
    """Through the look at the upload, as the service does."""
    assert detect_format(data[:4096], len(data), "part.stl") is Format.STL
    return read_stl(data, SETTINGS)


def corners_of(contents: Contents) -> FloatArray:
    vertices, faces = joined(contents)
    return vertices[faces]


def codes(contents: Contents) -> list[str]:
    return [note.code for note in contents.notes]


TEXT = text(CORNERS)
TEXTS: dict[str, bytes] = {
    "CRLF (Windows)": TEXT.replace("\n", "\r\n").encode(),
    "CR (Mac OS 9)": TEXT.replace("\n", "\r").encode(),
    "tabs and leading spaces (SolidWorks)": TEXT.replace(" ", "\t").replace("\n", "\n   ").encode(),
    "upper case (AutoCAD, CATIA)": TEXT.upper().encode(),
    "one line (scripts)": TEXT.replace("\n", " ").encode(),
    "blank lines": TEXT.replace("\n", "\n\n").encode(),
    "no name": TEXT.replace(" part", "").encode(),
    "UTF-8 name": TEXT.replace("part", "Gehäuse 部品").encode(),
    "long name": TEXT.replace("part", "x" * 9000).encode(),
    "name with keywords": TEXT.replace("part", "my facet normal of endsolid vertex 1").encode(),
    "byte order mark of UTF-8 (.NET)": b"\xef\xbb\xbf" + TEXT.encode(),
    "UTF-16 (redirection in PowerShell)": TEXT.encode("utf-16"),
    "UTF-16 big endian": b"\xfe\xff" + TEXT.encode("utf-16-be"),
    "no endsolid": TEXT.replace("endsolid part\n", "").encode(),
    "no solid": TEXT.replace("solid part\n", "", 1).encode(),
    "end solid, end facet, end loop (old CAD)": TEXT.replace("end", "end ").encode(),
    "endsolidNAME (Assimp issue 3756)": TEXT.replace("endsolid part", "endsolidpart").encode(),
    "NaN normals (MeshLab, Blender of slivers)": TEXT.replace(
        "normal 0 0 0", "normal nan -nan(ind) 1.#QNAN"
    ).encode(),
    "exponents (VTK)": text(CORNERS, number="{:.9e}").encode(),
    "capital exponents (CATIA)": text(CORNERS, number="{:+.9E}").encode(),
    "end of file of DOS": TEXT.encode() + b"\x1a\0\0",
    "color line": TEXT.replace("solid part\n", "solid part\ncolor 0.5 0.5 0.5\n", 1).encode(),
    "outerloop in one word, once": TEXT.replace("outer loop", "outerloop", 3).encode(),
    "comma and space (bergey/STL issue 3)": text(CORNERS, number="{:.9g},").replace(",\n", "\n").encode(),
}


@pytest.mark.parametrize("dialect", TEXTS)
def test_a_dialect_of_ascii_has_the_same_triangles(dialect: str) -> None:
    contents = read(TEXTS[dialect])
    np.testing.assert_allclose(corners_of(contents), CORNERS, rtol=1e-6, atol=1e-7)
    assert contents.notes == () and len(contents.bodies) == 1


def test_commas_without_spaces_are_not_guessed() -> None:
    with pytest.raises(errors.UnreadableFile, match="line 4 of the STL"):
        read(text(np.round(CORNERS)).replace("vertex ", "vertex 1,2,3 ").encode())


def test_decimal_commas_are_read_with_a_note() -> None:
    """MeshLab issue 372, Unity exporters: numbers in the locale of the user."""
    contents = read(TEXT.replace(".", ",").encode())
    np.testing.assert_allclose(corners_of(contents), CORNERS, rtol=1e-6, atol=1e-7)
    assert codes(contents) == ["decimal_comma"]


def test_each_solid_of_a_file_is_a_body_with_its_name() -> None:
    contents = read(
        (text(CORNERS[:5], "left arm") + text(CORNERS[5:9], "right") + text(CORNERS[:0])).encode()
    )
    assert [body.name for body in contents.bodies] == ["left arm", "right"]
    assert [len(body.faces) for body in contents.bodies] == [5, 4]
    np.testing.assert_allclose(corners_of(contents), CORNERS[:9], rtol=1e-6, atol=1e-7)


def test_a_facet_with_more_vertices_is_cut_into_triangles() -> None:
    square = np.array([(0, 0, 0), (2, 0, 0), (2, 2, 0), (0, 2, 0)], dtype=float)
    vertices, faces = joined(read(f"solid\n{facet(square)}{facet(square[:3] + 5)}endsolid\n".encode()))
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    np.testing.assert_allclose(np.cross(b - a, c - a).sum(axis=0) / 2, (0, 0, 6))
    assert len(faces) == 3


REFUSED: dict[str, tuple[str, type[errors.PipelineError], str]] = {
    "cut in a facet": (TEXT[:300], errors.TruncatedFile, "line 17, before outer loop"),
    "cut after a vertex": ("solid a\n" + facet(CORNERS[0])[:60], errors.TruncatedFile, "line 4"),
    "two numbers": (
        TEXT.replace("vertex", "vertex 0 0\nvertex", 1),
        errors.UnreadableFile,
        "line 5 .*'vertex'",
    ),
    "four numbers": (TEXT.replace("\nendloop", " 7\nendloop", 1), errors.UnreadableFile, "line 6 .*'7'"),
    "Fortran exponent": (
        "solid a\n" + facet(CORNERS[0], "{:.3f}d0") + "endsolid",
        errors.UnreadableFile,
        "line 4 .*d0'",
    ),
    "a word": (TEXT.replace("endloop", "endlop", 1), errors.UnreadableFile, "line 7 .*'endlop'"),
    "two vertices": (
        "solid a\n" + facet(CORNERS[0][:2]) + "endsolid",
        errors.UnreadableFile,
        "line 6 .* 2 vertices",
    ),
    "thousands": (
        TEXT.replace("vertex", "vertex 1,000.5 0 0\nvertex", 1),
        errors.UnreadableFile,
        "line 4 .* comma",
    ),
}


@pytest.mark.parametrize("case", REFUSED)
def test_a_broken_ascii_file_is_refused_with_its_line(case: str) -> None:
    written, expected, words = REFUSED[case]
    for ends in ("\n", "\r\n", "\r"):
        with pytest.raises(expected, match=words):
            read(written.replace("\n", ends).encode())


BINARIES: dict[str, tuple[bytes, list[str]]] = {
    "plain": (binary(CORNERS), []),
    "header that starts with solid (SolidWorks, Rhino)": (binary(CORNERS, b"solid facet normal part"), []),
    "two bytes after the end (several exporters)": (binary(CORNERS) + b"\r\n", []),
    "solid header and two bytes after the end": (binary(CORNERS, b"solid facet") + b"\0\0", []),
    "100 bytes and more after the end": (binary(CORNERS) + b"\1" * 130, ["bytes_after_stl"]),
    "count 0 (OpenSCAD to a pipe, issue 5380)": (binary(CORNERS, count=0), ["stl_count"]),
    "count -1 (streaming writers)": (binary(CORNERS, count=0xFFFFFFFF), ["stl_count"]),
    "colours in the attributes (Magics, VisCAM)": (binary(CORNERS, b"COLOR=\1\2\3\4", attribute=0x7FFF), []),
    "colours and bytes after the end": (binary(CORNERS, attribute=0x801F) + b"\0\0\0", []),
}


@pytest.mark.parametrize("dialect", BINARIES)
def test_a_dialect_of_binary_has_the_same_triangles(dialect: str) -> None:
    data, notes = BINARIES[dialect]
    contents = read(data)
    np.testing.assert_array_equal(corners_of(contents), CORNERS)
    assert codes(contents) == notes


def test_files_one_after_the_other_are_all_read() -> None:
    contents = read(binary(CORNERS[:7]) + binary(CORNERS[7:10]) + binary(CORNERS[10:]))
    np.testing.assert_array_equal(corners_of(contents), CORNERS)
    assert codes(contents) == ["several_stl"] and "3 binary STL files" in contents.notes[0].detail


def test_attributes_that_are_lengths_are_stepped_over() -> None:
    """As 3D Systems specified it: the attribute is the number of bytes that follow its triangle."""
    data = b" " * 80 + struct.pack("<I", len(CORNERS))
    for number, each in enumerate(CORNERS):
        data += binary(each[None], attribute=number % 3)[84:] + b"\7" * (number % 3)
    np.testing.assert_array_equal(corners_of(read(data)), CORNERS)


def test_triangles_that_are_not_announced_are_counted_in_a_note() -> None:
    contents = read(binary(CORNERS, count=len(CORNERS) - 3))
    assert len(contents.bodies[0].faces) == len(CORNERS) - 3
    assert "150 bytes" in contents.notes[0].detail and "3 more triangles" in contents.notes[0].detail


def test_broken_binary_files_are_refused() -> None:
    with pytest.raises(errors.TruncatedFile, match="which is 79 triangles"):
        read_stl(binary(CORNERS)[:-1], SETTINGS)
    with pytest.raises(errors.UnreadableFile, match="announces 0 triangles, and 3999 bytes"):
        read(binary(CORNERS, count=0)[:-1])
    with pytest.raises(errors.MeshTooLarge, match="80 triangles; the limit is 79"):
        read_stl(binary(CORNERS), LoadSettings(max_faces=79))
    with pytest.raises(errors.MeshTooLarge, match="79"):
        read_stl(TEXT.encode(), LoadSettings(max_faces=79))


@pytest.mark.timeout(60)
def test_one_line_of_many_solids_takes_time_in_proportion() -> None:
    one = ("solid a " + facet(CORNERS[0]).replace("\n", " ") + "endsolid a ").encode()
    assert sum(len(body.faces) for body in read(one * 20_000).bodies) == 20_000
    with pytest.raises(errors.PipelineError):
        read_stl(b"solid a facet normal 0 0 1 outer loop " * 100_000, SETTINGS)


@given(
    count=st.integers(1, 12),
    name=st.text(st.characters(exclude_categories=["Cs", "Cc", "Zl", "Zp"]), max_size=30),
    ender=st.sampled_from(["\n", "\r\n", "\r"]),
    number=st.sampled_from(["{:.9g}", "{:.9e}", "{:.4f}", "{:+.2E}"]),
    every=st.integers(0, 11),
)
def test_any_name_and_number_is_read(count: int, name: str, ender: str, number: str, every: int) -> None:
    corners = CORNERS[:count]
    written = text(corners, name, number).replace("endfacet", "end facet", every).replace("\n", ender)
    expected = np.array([[[float(number.format(x)) for x in p] for p in t] for t in corners])
    contents = read(written.encode())
    np.testing.assert_array_equal(corners_of(contents), expected)
    assert contents.bodies[0].name.split() == name.split()


@given(
    st.integers(0, len(TEXT)), st.sampled_from(["", "nan", "-", "vertex", "endfacet\n", "solid", "1,5", "\0"])
)
def test_a_change_of_ascii_is_read_or_refused(at: int, word: str) -> None:
    try:
        assert len(read_stl((TEXT[:at] + word + TEXT[at + 5 :]).encode(), SETTINGS).bodies) <= 2
    except errors.PipelineError as refused:
        assert refused.reason and refused.remedy
