"""Every dialect of point text gives the points that its writer meant, or is refused with line and reason."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline import Format, MeshFile, detect_format
from pipeline.core import errors
from pipeline.core.formats import HEAD_BYTES
from pipeline.core.settings import LoadSettings
from pipeline.stages.load import load, point_text_columns
from pipeline.stages.load.contents import Contents
from pipeline.stages.load.point_text import read_point_text

SETTINGS = LoadSettings()
POINTS = [
    (-92.3914, 86.25, 53.8669),
    (80.1909, -0.5, 53.3975),
    (-47.6016, 75.0767, 42.5906),
    (1.5, 2.25, -3.125),
]
PTX_HEAD = "{}\n{}\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n"
IDENTITY = "1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n"


def rows(delimiter: str = " ", before: str = "", after: str = "", digits: int = 4) -> str:
    """Lines of `POINTS`; {i} in before and after is the number of the point."""
    return "".join(
        before.format(i=i)
        + delimiter.join(f"{value:.{digits}f}" for value in point)
        + after.format(i=i)
        + "\n"
        for i, point in enumerate(POINTS, 1)
    )


def read(text: str | bytes, **limits: Any) -> Contents:
    return read_point_text(text.encode() if isinstance(text, str) else text, LoadSettings(**limits))


def points(contents: Contents) -> list[tuple[float, ...]]:
    return [tuple(point) for body in contents.bodies for point in body.vertices.tolist()]


def codes(contents: Contents) -> list[str]:
    return [note.code for note in contents.notes]


COMMA = rows(";").replace(".", ",")
#: Texts of `POINTS` as programs write them, and the codes of the notes.
DIALECTS: dict[str, tuple[str | bytes, list[str]]] = {
    "plain x y z (MeshLab .xyz, most scanners)": (rows(), []),
    "MeshLab .xyz with normals": (rows(after=" 0.000000 0.600000 0.800000"), []),
    "MeshLab .asc, tabs": (rows("\t"), []),
    "CloudCompare ASCII, heading and count": (
        "//X Y Z R G B\n4\n" + rows(after=" 255 128 0"),
        [],
    ),
    "CloudCompare ASCII, semicolons, heading": ("//X;Y;Z;Scalar_field\n" + rows(";", after=";nan"), []),
    "CloudCompare, comma and heading": ("//X,Y,Z,Nx,Ny,Nz\n" + rows(",", after=",0,0,1"), []),
    "Leica .pts, intensity and colour": ("4\n" + rows(after=" -1523 10 20 30"), []),
    "FARO SCENE .xyz, row and column first": ("row col X Y Z i\n" + rows(before="17 {i} ", after=" 0.5"), []),
    "FARO .xyz with colours": (rows(after=" 12 200 77"), []),
    "ZEISS / GOM Inspect ASCII, comments": ("# GOM ASCII\n# Unit: unknown\n# x y z\n" + rows(), []),
    "GOM CSV with ids and names": ('"Point ID";"X";"Y";"Z"\n' + rows(";", before='"P {i}";'), []),
    "Excel, German locale, .csv": ("X;Y;Z\r\n" + COMMA.replace("\n", "\r\n"), ["decimal_comma"]),
    "Excel, German locale, no heading": (COMMA, ["decimal_comma"]),
    "Excel, Unicode text: tabs, UTF-16": (
        ("X\tY\tZ\r\n" + rows("\t").replace(".", ",")).encode("utf-16"),
        ["decimal_comma"],
    ),
    "Excel, CSV UTF-8 with byte order mark": (b"\xef\xbb\xbfX,Y,Z\r\n" + rows(",").encode(), []),
    "Excel for Mac, CR": (("X,Y,Z\n" + rows(",")).replace("\n", "\r"), []),
    "LibreOffice CSV, all quoted, decimal commas": (
        "x,y,z\n" + rows('","', before='"', after='"').replace(".", "§").replace(",", ",").replace("§", ","),
        ["decimal_comma"],
    ),
    "decimal commas and spaces (German CMM)": (rows().replace(".", ","), ["decimal_comma"]),
    "fixed width (Fortran)": ("".join(f"{'':3}{line}\n" for line in rows("   ").splitlines()), []),
    "Fortran double precision": (
        "".join(" ".join(f"{v:.6e}" for v in p).replace("e", "D") + "\n" for p in POINTS),
        [],
    ),
    "ParaView CSV": ("Points:0,Points:1,Points:2,Normals:0,T\n" + rows(",", after=",0,{i}"), []),
    "ParaView CSV, data first": ('"T","Points:0","Points:1","Points:2"\n' + rows(",", before="{i},"), []),
    "Agisoft Metashape, labels": ("#Label,X,Y,Z\n" + rows(",", before="point {i},"), []),
    "survey: point, easting, northing, height": (
        "Point ID,Easting,Northing,Height\n" + rows(",", "P{i},"),
        [],
    ),
    "pandas with index": (",x,y,z\n" + rows(",", before="{i},"), []),
    "numpy.savetxt with header": ("# x y z intensity\n" + rows(after=" 1.0e+00"), []),
    "PostgreSQL export, pipes": (" id | x | y | z\n" + rows(" | ", before="{i} | "), []),
    "columns in another order": (
        "z;y;x\n" + "".join(f"{z:.4f};{y:.4f};{x:.4f}\n" for x, y, z in POINTS),
        [],
    ),
    "two words in a name": ("Point ID X Y Z\n" + rows(before="{i} "), []),
    "numbered points": (rows(before="{i} "), ["numbered_points"]),
    "delimiter at the end": ("x;y;z;\n" + rows(";", after=";"), []),
    "comma and space": (rows(", "), []),
    "heading in Latin-1": ("Stärke;x;y;z\n".encode("latin-1") + rows(";", before="1;").encode(), []),
    "comments of all kinds": ("% a\n! b\n; c\n// d\n\n" + rows(after="  # e"), []),
    "comment that mentions the axes": ("# unit mm, axes x y z, right-handed\n" + rows(), []),
    "title": ("Scan of the bracket with the small lens\n" + rows(), ["lines_not_read"]),
    "no line end after the last": (rows().rstrip("\n"), []),
    "typographic minus": (rows().replace("-", "\N{MINUS SIGN}"), []),
}


@pytest.mark.parametrize("dialect", DIALECTS)
def test_a_dialect_gives_its_points(dialect: str, tmp_path: Path) -> None:
    text, notes = DIALECTS[dialect]
    data = text.encode() if isinstance(text, str) else text
    contents = read(data)
    np.testing.assert_allclose(points(contents), POINTS, atol=1e-9)
    assert codes(contents) == notes and contents.unit is None
    assert detect_format(data[:HEAD_BYTES], len(data), "scan.dat") is Format.XYZ
    path = tmp_path / "scan.dat"
    path.write_bytes(data)
    loaded = load(MeshFile(path), "scan", SETTINGS, needs_surface=False)
    assert len(loaded.mesh.vertices) == len(POINTS) and loaded.unit == "mm"


@pytest.mark.parametrize("dialect", DIALECTS)
def test_a_long_text_is_recognised_from_its_start(dialect: str) -> None:
    text, _ = DIALECTS[dialect]
    data = text if isinstance(text, bytes) else text.encode()
    assert detect_format(data[:130], 10**6, "scan.txt") is Format.XYZ


@pytest.mark.parametrize(
    ("heading", "unit"),
    [
        ("x[mm];y[mm];z[mm]", "millimeter"),
        ("X (m);Y (m);Z (m)", "meter"),
        ("X [in];Y [in];Z [in]", "inch"),
        ("x_cm;y_cm;z_cm", "centimeter"),
        ("X/mm;Y/mm;Z/mm", "millimeter"),
        ("x in mm;y in mm;z in mm", "millimeter"),
        ("X [µm];Y [µm];Z [µm]", "micron"),
        ("x-coordinate;y-coordinate;z-coordinate", None),
        (
            "X [furlong];Y [furlong];Z [furlong]",
            "furlong",
        ),  # refused by `unit_of`, unless options.units helps
    ],
)
def test_the_unit_of_the_heading_is_declared(heading: str, unit: str | None) -> None:
    contents = read(heading + "\n" + rows(";"))
    assert contents.unit == unit and points(contents) == POINTS


def test_a_unit_of_some_axes_is_not_used_and_said() -> None:
    contents = read("X Y Z [m]\n" + rows())
    assert points(contents) == POINTS and contents.unit is None and codes(contents) == ["unit_not_used"]


#: text, error, words of the reason or the remedy
REFUSED: dict[str, tuple[str | bytes, type[errors.PipelineError], str]] = {
    "six whole numbers by commas": ("1,5,2,5,3,5\n" * 3, errors.UnreadableFile, "1,5; 2,5; 3,5"),
    "four whole numbers by commas": ("1,5,2,3\n4,5,6,7\n", errors.UnreadableFile, "two ways"),
    "thousands with point and comma": ("1.234,5;2,5;3,5\n", errors.UnreadableFile, "separators of thousands"),
    "thousands with comma and point": ("1,234.5;2.5;3.5\n", errors.UnreadableFile, "separators of thousands"),
    "thousands with spaces": ("1 234,5;2,5;3,5\n", errors.UnreadableFile, "separators of thousands"),
    "thousands with apostrophes": ("1'234.5 2.5 3.5\n", errors.UnreadableFile, "separators of thousands"),
    "thousands twice": ("1,234,567;2;3\n", errors.UnreadableFile, "separators of thousands"),
    "thousands or decimals": ("1,234;2;3\n4;5,678;6\n", errors.UnreadableFile, "1,234 is 1.234"),
    "Excel thousands in quotes": ('"1,234",512,"3,456"\n', errors.UnreadableFile, "1,234 is 1234"),
    "points and commas": ("1,5;2;3\n1.5;2;3\n", errors.UnreadableFile, "line 2"),
    "whole ids and whole points": (
        "1 15 25 35\n2 12 21 37\n3 12 22 34\n",
        errors.UnreadableFile,
        "columns 2 to 4",
    ),
    "ids with gaps": ("7 1.5 2.5 3.5\n9 1.5 2.5 3.7\n", errors.UnreadableFile, "columns 2 to 4"),
    "times first": ("0.1 5 2 3\n0.2 4 2 3\n0.3 1 2 3\n0.4 2 1 2\n", errors.UnreadableFile, "as a time"),
    "numbers as heading (pandas)": ("0,1,2\n0.5,1.5,2.5\n1.5,0.5,2.5\n", errors.UnreadableFile, "two ways"),
    "comment in another order": ("# z y x\n1 2 3 4\n1 1 5 6\n", errors.UnreadableFile, "z y x"),
    "heading without x y z": ("a b c\n1 2 3\n", errors.UnreadableFile, "does not name x, y and z"),
    "heading of other length": ("id x y z\n1 2 3\n", errors.UnreadableFile, "4 words"),
    "two x": ("x x y z\n1 2 3 4\n", errors.UnreadableFile, "2 columns"),
    "different units": ("x[mm] y[mm] z[m]\n1 2 3\n", errors.UnreadableFile, "different units"),
    "a row with less columns": ("1 2 3\n\n4 5\n6 7 8\n", errors.UnreadableFile, "line 3 has 2 columns"),
    "a row with more columns": ("# a\n1;2;3\n4;5;6;7\n", errors.UnreadableFile, "line 3 has 4 columns"),
    "an empty line and a word": ("x,y,z\n1,2,3\n\n1,two,3\n", errors.UnreadableFile, "line 4 has 'two'"),
    "a hexadecimal number": ("1 2 3\n0x10 2 3\n", errors.UnreadableFile, "0x10"),
    "an underscore": ("1 2 3\n1_0 2 3\n", errors.UnreadableFile, "1_0"),
    "two columns": ("1 2\n3 4\n", errors.UnreadableFile, "three numbers"),
    "cut within a row": ("1 2 3\n4 5 6\n7 8", errors.TruncatedFile, "line 3"),
    "cut within a number": ("1.2345 2.3456 3.4567\n" * 20 + "1.2345 2.3456 3.4", errors.TruncatedFile, "3.4"),
    "count and less rows (.pts)": ("3\n" + rows()[:20] + "\n1 2 3\n", errors.TruncatedFile, "announces 3"),
    "second block cut (.pts)": ("1\n1 2 3\n2\n4 5 6\n", errors.TruncatedFile, "line 3 announces 2"),
    "first block short (.pts)": ("2\n1 2 3\n1\n4 5 6\n", errors.TruncatedFile, "before the next count"),
    "PTX with less rows": (PTX_HEAD.format(2, 2) + IDENTITY + "1 2 3 0\n", errors.TruncatedFile, "4 lines"),
    "PTX with a huge grid": (
        PTX_HEAD.format(999999999, 999999999) + IDENTITY + "1 2 3 0\n",
        errors.TruncatedFile,
        "scan 1",
    ),
    "PTX cut in its head": (
        PTX_HEAD.format(1, 1) + IDENTITY + "1 2 3 0\n2\n2\n",
        errors.TruncatedFile,
        "head of scan 2",
    ),
    "PTX with its translation as a column": (
        PTX_HEAD.format(1, 1) + "1 0 0 5\n0 1 0 0\n0 0 1 0\n0 0 0 1\n1 2 3 0\n",
        errors.UnreadableFile,
        "last column",
    ),
    "PTX with a transform of zeros": (
        PTX_HEAD.format(1, 1) + "0 0 0 0\n0 0 0 0\n0 0 0 0\n0 0 0 1\n1 2 3 0\n",
        errors.UnreadableFile,
        "plane",
    ),
    "all rows NaN": ("nan nan nan\n" * 4, errors.NotFinite, "4 of 4"),
    "no rows": ("# only a comment\n", errors.UnreadableFile, "no points"),
    "PCD": (
        "# .PCD v0.7\nVERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nDATA ascii\n1 2 3\n",
        errors.UnreadableFile,
        "does not name",
    ),
    "VTK": (
        "# vtk DataFile\ntitle\nASCII\nPOINTS 3 float\n0 0 0 1 1 1\n",
        errors.UnreadableFile,
        "does not name",
    ),
    "a line of many numbers": ("1 2 3\n" + "1 " * 40_000 + "\n", errors.UnreadableFile, "more than 65536"),
    "a first line of many numbers": ("1 " * 40_000 + "\n", errors.UnreadableFile, "more than 65536"),
    "too many blocks": ("1\n1 2 3\n" * 1001, errors.MeshTooLarge, "lines that count"),
    "too many scans": (
        (PTX_HEAD.format(1, 1) + IDENTITY + "1 2 3 0\n") * 1001,
        errors.MeshTooLarge,
        "more than 1000 scans",
    ),
    "comments without end": ("#\n" * 10_001, errors.UnreadableFile, "first 10000 lines"),
    "infinite ids": ("inf 1 2 3\n" * 5, errors.NotFinite, "5 of 5"),
    "zero bytes": (b"1 2 3\n\0\n", errors.UnreadableFile, "zero"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_is_not_certain_is_refused_with_its_line(case: str) -> None:
    text, error, words = REFUSED[case]
    with pytest.raises(error) as caught:
        read(text)
    assert words in caught.value.reason and len(caught.value.remedy) > 10
    assert caught.value.mesh is None and len(caught.value.detail) < 500


@pytest.mark.parametrize("case", ["six whole numbers by commas", "whole ids and whole points", "times first"])
def test_a_heading_makes_it_certain(case: str) -> None:
    text, _, _ = REFUSED[case]
    assert isinstance(text, str)
    delimiter = "," if "," in text else " "
    n = len(text.split("\n")[0].split(delimiter))
    names = ["x", "y", "z", "a", "b", "c"][:n]
    expected = [tuple(float(word) for word in line.split(delimiter)[:3]) for line in text.splitlines()]
    assert points(read(delimiter.join(names) + "\n" + text)) == expected


def test_a_heading_of_three_names_makes_pairs_of_six_fields() -> None:
    contents = read("x,y,z\n1,5,-2,25,3,05\n0,5,2,5,3,5\n-0,5,1,0,0,0\n")
    assert points(contents) == [(1.5, -2.25, 3.05), (0.5, 2.5, 3.5), (-0.5, 1.0, 0.0)]
    assert codes(contents) == ["decimal_comma"]


@pytest.mark.parametrize("word", ["nan", "NaN", "-nan(ind)", "1.#QNAN", "inf", "", "null", "N/A", "-"])
def test_rows_without_a_position_are_counted(word: str) -> None:
    contents = read("x;y;z;i\n" + rows(";", after=";7") + f"{word};1;2;7\n" + rows(";", after=";7"))
    assert points(contents) == POINTS * 2 and codes(contents) == ["points_without_position"]
    assert "1 of 9 points" in contents.notes[0].detail


def test_blocks_of_pts_are_bodies() -> None:
    contents = read("4\n" + rows(after=" 1 2 3 4") + "1\n1 2 3 1 2 3 4\n")
    assert [len(body.vertices) for body in contents.bodies] == [4, 1] and contents.notes == ()
    assert points(contents)[-1] == (1.0, 2.0, 3.0)
    more = read("2\n" + rows(after=" 5 1 1 1"))
    assert points(more) == POINTS and codes(more) == ["more_points_than_announced"]


def test_ptx_scans_are_moved_and_directions_without_return_left_out() -> None:
    """A quarter turn about z and a translation, as Leica writes it: [x y z 1] @ T."""
    turn = "0 1 0 0\n-1 0 0 0\n0 0 1 0\n10 20 30 1\n"
    text = PTX_HEAD.format(2, 2) + turn + "1 2 3 0.5\n0 0 0 0.5\n4 5 6 0.1\n0 0 0 0\n"
    text += PTX_HEAD.format(1, 1) + IDENTITY + "7 8 9 0.5 1 2 3\n"
    contents = read(text)
    assert points(contents) == [(8.0, 21.0, 33.0), (5.0, 24.0, 36.0), (7.0, 8.0, 9.0)]
    assert [body.name for body in contents.bodies] == ["scan 1", "scan 2"]
    first, second = (body.scanner for body in contents.bodies)
    assert first is None  # the head says 0 0 0, the transform 10 20 30: which it is, is not certain
    assert second is not None and second.tolist() == [0, 0, 0]
    assert codes(contents) == ["points_without_position"] and "2 of 5" in contents.notes[0].detail
    assert detect_format(text.encode(), len(text), "a.ptx") is Format.XYZ
    flipped = read(PTX_HEAD.format(1, 1) + "1 0 0 0\n0 1 0 0\n0 0 -1 0\n0 0 0 1\n1 2 3 0\n")
    assert codes(flipped) == ["ptx_transform"]


def test_too_many_points_are_refused() -> None:
    with pytest.raises(errors.MeshTooLarge, match="4 points; the limit is 3"):
        read(rows(), max_points=3)
    with pytest.raises(errors.MeshTooLarge, match="limit"):
        read(PTX_HEAD.format(4, 1) + IDENTITY + rows(after=" 0"), max_points=3)


def test_a_text_of_several_blocks_is_read_as_one(monkeypatch: pytest.MonkeyPatch) -> None:
    """Errors keep their line, and a rule sees all rows: the id skips a number in the second block."""
    monkeypatch.setattr(point_text_columns, "BLOCK_BYTES", 1000)
    n = 300
    lines = [f"{i} 1.5 2.5 {i}.5" for i in range(n)]
    contents = read("\n".join(lines) + "\n")
    assert len(points(contents)) == n and points(contents)[-1] == (1.5, 2.5, n - 0.5)
    lines[-2] = "x" + lines[-2]
    with pytest.raises(errors.UnreadableFile, match=f"line {n - 1} has 'x"):
        read("\n".join(lines))
    lines[-2] = lines[-2][2:]
    with pytest.raises(errors.UnreadableFile, match="two ways"):
        read("\n".join(lines))


NUMBER = st.integers(-(10**6), 10**6)


@st.composite
def texts(draw: st.DrawFn) -> tuple[str, list[tuple[float, ...]], bool]:
    """A cloud in some layout; its points to the printed digits; whether it must be read."""
    digits = draw(st.integers(0, 4))
    cloud = draw(st.lists(st.tuples(NUMBER, NUMBER, NUMBER), min_size=1, max_size=7))
    delimiter = draw(st.sampled_from([" ", "\t", ",", ";", "|", "  ", ", ", " ; "]))
    comma, heading, trimmed = draw(st.booleans()), draw(st.booleans()), draw(st.booleans())
    before = draw(st.sampled_from(["", "id", "id from 0", "label", "time", "other ids"]))
    after = draw(st.sampled_from(["", "i", "rgb", "normal", "i rgb"]))
    names: list[str] = []
    lines: list[str] = []
    expected: list[tuple[float, ...]] = []
    others = draw(st.permutations(range(10, 10 + len(cloud))))
    for at, point in enumerate(cloud):
        words = [f"{value / 10**digits:.{digits}f}" for value in point]
        if trimmed and digits:
            words = [word.rstrip("0").rstrip(".") for word in words]
        expected.append(tuple(float(word) for word in words))
        first: dict[str, list[Any]] = {
            "": [],
            "id": [at + 1],
            "id from 0": [at],
            "label": [f"P{at}"],
            "other ids": [others[at]],
        }
        first["time"] = [f"{0.25 * (at + 1):.2f}"]
        last: dict[str, list[Any]] = {
            "": [],
            "i": [at * 7 % 5],
            "rgb": [1, 20, 255],
            "normal": ["0.00", "0.60", "0.80"],
        }
        last["i rgb"] = [0.5, 1, 20, 255]
        fields = [*map(str, first[before]), *words, *map(str, last[after])]
        lines.append(delimiter.join(field.replace(".", ",") if comma else field for field in fields))
        names = ["a"] * len(first[before]) + ["x", "y", "z"] + ["b"] * len(last[after])
    text = "\n".join([delimiter.join(names)] * heading + lines) + "\n"
    commas_only = comma and delimiter.strip() == ","
    certain = heading and not commas_only and not (comma and (digits == 3 or trimmed))
    return text, expected, certain or (not comma and not before and not after and digits > 0 and not trimmed)


@given(texts())
def test_a_cloud_in_any_layout_is_read_rightly_or_refused(
    case: tuple[str, list[tuple[float, ...]], bool],
) -> None:
    text, expected, certain = case
    try:
        found = points(read(text))
    except errors.UnreadableFile:
        assert not certain, text
    else:
        assert found == expected, text


@given(
    st.binary(max_size=300) | st.text("0123456789.,;| \t\n-+eDxyz#\"'/nan()", max_size=200).map(str.encode)
)
def test_no_text_fails_but_on_purpose(data: bytes) -> None:
    try:
        read(data)
    except errors.PipelineError as refused:
        assert refused.detail
