"""Texts with two meanings are read as the columns say that a person states; without, they name the option."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline import MeshFile, PointColumns, errors
from pipeline.core.settings import LoadSettings
from pipeline.stages.load import load
from pipeline.stages.load.point_text import read_point_text

POINTS = [(7.5, -2.25, 3.125), (1.0, 4.5, -6.75), (0.5, 8.0, 9.25), (-4.0, 2.0, 1.5)]


def lines(form: str, *, comma: bool = False) -> bytes:
    """A line for each point. form : with {x}, {y}, {z}, and {i}, a number with gaps, {t}, a time"""
    made = "\n".join(
        form.format(i=5 * i + 3, t=0.25 * i, x=x, y=y, z=z) for i, (x, y, z) in enumerate(POINTS)
    )
    return (made.replace(".", ",") if comma else made).encode() + b"\n"


#: Text, columns that say what it means, and whether it is refused without.
MEANT = {
    "ids with gaps": (lines("{i} {x} {y} {z}"), "id,x,y,z", True),
    "ids with gaps, by number": (lines("{i} {x} {y} {z}"), "2,3,4", True),
    "times": (lines("{t} {x} {y} {z}"), "t x y z", True),
    "six fields by commas are three numbers": (lines("{x},{y},{z}", comma=True), "x,y,z", True),
    "six fields, by number": (lines("{x},{y},{z}", comma=True), "1,2,3 decimal=comma", True),
    "another order": (lines("{z};{y};{x}"), "z;y;x", False),
    "commas as decimals and semicolons": (
        lines("{x:.3f};{y:.3f};{z:.3f}", comma=True),
        "x,y,z decimal=comma delimiter=semicolon",
        False,
    ),
    "what stands between is not read": (lines("{x} {i} {y} {t} {z} {t}"), "1,3,5", False),
    "the option is over the heading": (b"y x z\n" + lines("{x} {y} {z}"), "x,y,z", False),
    "a delimiter at the end": (lines("{i};{x};{y};{z};"), "id,x,y,z", True),
}


def points(data: bytes, columns: str | None) -> np.ndarray:
    contents = read_point_text(data, LoadSettings(), columns)
    return np.concatenate([body.vertices for body in contents.bodies])


@pytest.mark.parametrize("case", MEANT)
def test_columns_decide(case: str) -> None:
    data, columns, is_refused = MEANT[case]
    np.testing.assert_allclose(points(data, columns), POINTS, atol=1e-12)
    if is_refused:
        with pytest.raises(errors.UnreadableFile, match=r"two ways.*options\.columns"):
            points(data, None)


def test_four_columns_can_be_read_both_ways() -> None:
    data = b"".join(b"%d 1%d.5 2%d.25 3.125\n" % (9 * i, i, i) for i in range(4))
    assert points(data, "x,y,z,i")[1].tolist() == [9.0, 11.5, 21.25]
    assert points(data, "i,x,y,z")[1].tolist() == [11.5, 21.25, 3.125]


def test_commas_that_may_separate_thousands_are_decimals_when_stated() -> None:
    data = b"1,234;5;7,890\n2,468;6;1,125\n3,579;7;2,250\n"
    with pytest.raises(errors.UnreadableFile, match=r"two ways.*thousands.*decimal=comma"):
        points(data, None)
    assert points(data, "x,y,z decimal=comma")[0].tolist() == [1.234, 5.0, 7.89]


def test_the_unit_of_the_heading_still_counts() -> None:
    data = b"id x[cm] y[cm] z[cm]\n" + lines("{i} {x} {y} {z}")
    assert read_point_text(data, LoadSettings(), "2,3,4").unit == "centimeter"


@pytest.mark.parametrize(
    ("data", "columns", "reason"),
    [
        (lines("{x} {y} {z}"), "id,x,y,z", "line 1 has no numbers in the columns"),
        (lines("{x} {y} {z}"), "2,3,4", "line 1 has no numbers in the columns"),
        (lines("{x};{y};{z}"), "x,y,z delimiter=tab", "line 1 has no numbers in the columns"),
        (lines("{x} {y} {z}"), "x,y", "0 columns are named z"),
        (lines("{x} {y} {z}"), "x,x,y,z", "2 columns are named x"),
        (lines("{x} {y} {z}"), "1,2", "2 numbers of columns"),
        (lines("{x} {y} {z}"), "1,1,2", "3 numbers of columns"),
        (lines("{x} {y} {z}"), "", "0 columns are named x"),
        (lines("{x} {y} {z}"), "x,y,z decimal=dot", "decimal=dot is not known"),
    ],
)
def test_columns_that_do_not_fit_are_refused(data: bytes, columns: str, reason: str) -> None:
    with pytest.raises(errors.ColumnsUnfit, match=reason):
        points(data, columns)


@pytest.mark.parametrize(("comma", "said"), [(True, "point"), (False, "comma")])
def test_decimals_must_be_as_stated(comma: bool, said: str) -> None:
    data = lines("{x} {y} {z}", comma=comma)
    with pytest.raises(errors.UnreadableFile, match=f"line 1 does not have decimals.*decimal={said}"):
        points(data, f"x,y,z decimal={said}")


def test_other_formats_have_no_columns(tmp_path: Path) -> None:
    path = tmp_path / "scan.obj"
    path.write_bytes(b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    with pytest.raises(errors.ColumnsUnfit, match="the file is OBJ"):
        load(MeshFile(path, columns="x,y,z"), "scan", LoadSettings(), needs_surface=False)


@given(st.text(max_size=40))
def test_any_text_is_columns_or_says_how_they_are_written(stated: str) -> None:
    try:
        found = PointColumns.of(stated)
    except ValueError as error:
        assert "id,x,y,z" in str(error)
    else:
        assert len(set(found.columns)) == 3
