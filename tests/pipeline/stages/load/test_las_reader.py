"""LAS and LAZ are read with scale, offset and unit, without noise, or refused with what is wrong.

The files are written by `laspy` and changed here. Dialects are named with their public source.
"""

import io
import struct
from pathlib import Path
from typing import Any

import laspy
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from laspy.vlrs.known import GeoKeyDirectoryVlr, GeoKeyEntryStruct, WktCoordinateSystemVlr

from pipeline.core import errors
from pipeline.core.formats import Format, detect_format
from pipeline.core.mesh_file import MeshFile
from pipeline.core.settings import LoadSettings
from pipeline.stages.load import las, load
from pipeline.stages.load.contents import Contents, joined
from pipeline.stages.load.las import read_las
from pipeline.stages.load.las_unit import unit_of_las

POINTS = np.random.default_rng(0).random((400, 3)) * [10, 20, 30] + [5e5, 4e6, 100]
FORMATS = [
    ("1.1", 0),
    ("1.1", 1),
    ("1.2", 2),
    ("1.2", 3),
    ("1.3", 4),
    ("1.3", 5),
    *(("1.4", k) for k in range(11)),
]
METRE = 'UNIT["metre",1,AUTHORITY["EPSG","9001"]]'
UTM = f'PROJCS["UTM",GEOGCS["WGS 84",DATUM["D",SPHEROID["S",6378137,298.2]],UNIT["degree",0.0174]],{METRE}]'


def made(
    version: str = "1.2",
    point_format: int = 3,
    *,
    compressed: bool = False,
    records: tuple[Any, ...] = (),
    **fields: Any,
) -> bytes:
    header = laspy.LasHeader(version=version, point_format=point_format)
    header.scales, header.offsets = [0.001] * 3, [5e5, 4e6, 0]
    header.vlrs.extend(records)
    points = laspy.LasData(header)
    points.x, points.y, points.z = POINTS.T
    for name, values in fields.items():
        points[name] = values
    out = io.BytesIO()
    points.write(out, do_compress=compressed)
    return out.getvalue()


def read(data: bytes, **limits: int) -> Contents:
    return read_las(data, LoadSettings(**limits))


def patched(data: bytes, at: int, layout: str, *values: float) -> bytes:
    content = bytearray(data)
    struct.pack_into(layout, content, at, *values)
    return bytes(content)


def keys(**values: int) -> GeoKeyDirectoryVlr:
    numbers = {"model": 1024, "system": 3072, "unit": 3076, "vertical": 4099}
    record = GeoKeyDirectoryVlr()
    record.geo_keys = []
    for name, value in values.items():
        entry = GeoKeyEntryStruct()
        entry.id, entry.tiff_tag_location, entry.count, entry.value_offset = numbers[name], 0, 1, value
        record.geo_keys.append(entry)
    record.geo_keys_header.number_of_keys = len(record.geo_keys)
    return record


def wkt(text: str) -> WktCoordinateSystemVlr:
    return WktCoordinateSystemVlr(text)


@pytest.mark.parametrize("compressed", [False, True], ids=["las", "laz"])
@pytest.mark.parametrize(("version", "point_format"), FORMATS)
def test_every_version_and_point_format_is_read(version: str, point_format: int, compressed: bool) -> None:
    data = made(version, point_format, compressed=compressed)
    assert detect_format(data[:4096], len(data)) == Format.LAS
    vertices, faces = joined(read(data))
    np.testing.assert_allclose(vertices, POINTS, atol=0.00051)
    assert not len(faces)


def test_las_1_0_is_read() -> None:
    np.testing.assert_allclose(joined(read(patched(made(), 25, "B", 0)))[0], POINTS, atol=0.00051)


def test_records_longer_than_their_format_are_read() -> None:
    # https://github.com/laspy/laspy/issues/157: bytes that no VLR describes
    data = made("1.2", 0)
    (start,) = struct.unpack_from("<I", data, 96)
    table = np.frombuffer(data[start:], dtype=np.uint8).reshape(len(POINTS), 20)
    longer = data[:start] + np.hstack([table, np.full((len(POINTS), 4), 255, np.uint8)]).tobytes()
    np.testing.assert_allclose(joined(read(patched(longer, 105, "<H", 24)))[0], POINTS, atol=0.00051)


def test_several_chunks_are_one_cloud(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(las, "CHUNK", 37)
    for compressed in (False, True):
        assert len(joined(read(made(compressed=compressed)))[0]) == len(POINTS)


@pytest.mark.parametrize("point_format", [3, 7])
def test_several_chunks_of_a_laz_are_read_and_a_lying_one_is_refused(point_format: int) -> None:
    """LAZ has 50,000 points in a chunk."""
    header = laspy.LasHeader(version="1.4", point_format=point_format)
    points = laspy.LasData(header)
    points.x = points.y = points.z = np.arange(120_000) / 100
    out = io.BytesIO()
    points.write(out, do_compress=True)
    data = out.getvalue()
    np.testing.assert_allclose(joined(read(data))[0][:, 2], np.arange(120_000) / 100, atol=1e-6)
    if point_format == 7:
        (start,) = struct.unpack_from("<I", data, 96)
        with pytest.raises(errors.TruncatedFile, match="chunk 0 of the LAZ announces"):
            read(patched(data, start + 8 + 36 + 4, "<I", 2**31))


@pytest.mark.parametrize("compressed", [False, True], ids=["las", "laz"])
def test_noise_and_withheld_points_are_left_out_and_counted(compressed: bool) -> None:
    classes = np.zeros(len(POINTS), dtype=np.uint8)
    classes[:3], classes[3:8] = 7, 18
    withheld = np.zeros(len(POINTS), dtype=np.uint8)
    withheld[2:10] = 1
    data = made("1.4", 6, compressed=compressed, classification=classes, withheld=withheld)
    contents = read(data)
    np.testing.assert_allclose(joined(contents)[0], POINTS[10:], atol=0.00051)
    assert [note.code for note in contents.notes] == ["points_left_out", "unit_assumed"]
    assert "8 classified as noise and 2 withheld of 400 points" in contents.notes[0].detail
    # in the old formats, class 18 is reserved and no noise
    old = read(made("1.2", 1, classification=classes))
    assert len(joined(old)[0]) == len(POINTS) - 3


def test_a_file_of_noise_only_is_refused() -> None:
    with pytest.raises(errors.UnreadableFile, match="neither noise nor withheld, of 400"):
        read(made(classification=np.full(len(POINTS), 7, dtype=np.uint8)))


@pytest.mark.parametrize(
    ("record", "unit"),
    [
        (keys(model=1, system=32632, unit=9001), "meter"),
        (keys(model=1, unit=9002, vertical=9002), "foot"),
        (keys(model=1, unit=9003), "us survey foot"),
        (keys(model=1, unit=9036), "EPSG:9036"),
        (keys(model=1, system=2056), "of the coordinate system EPSG:2056"),
        (wkt(UTM), "meter"),
        (wkt(UTM.replace(METRE, 'UNIT["US survey foot",0.3048006096012192]')), "us survey foot"),
        (wkt(f'COMPD_CS["x",{UTM},VERT_CS["h",VERT_DATUM["d",2005],{METRE}]]'), "meter"),
        (wkt(f'LOCAL_CS["site",{METRE}]'), "meter"),
        (wkt('ENGCRS["site",EDATUM["e"],CS[Cartesian,3],LENGTHUNIT["metre",1.0]]'), "meter"),
        (wkt('LOCAL_CS["site",UNIT["millimetre",0.001]]'), "millimeter"),
        (wkt('LOCAL_CS["site",UNIT["link",0.201168]]'), "link"),
        (wkt('LOCAL_CS["site"]'), "of its coordinate system, which names none"),
    ],
)
def test_the_unit_is_that_of_the_coordinate_system(record: Any, unit: str) -> None:
    contents = read(made("1.4", 6, records=(record,)))
    assert contents.unit == unit and contents.notes == ()


def test_a_file_without_coordinate_system_is_read_as_mm_with_a_note() -> None:
    contents = read(made())
    assert contents.unit is None and [note.code for note in contents.notes] == ["unit_assumed"]


def test_the_note_of_the_unit_is_left_out_where_the_user_says_it(tmp_path: Path) -> None:
    (tmp_path / "scan.las").write_bytes(made())
    for unit, expected in (("auto", ["unit_assumed"]), ("cm", [])):
        file = MeshFile(tmp_path / "scan.las", unit=unit)  # type: ignore[arg-type]
        loaded = load(file, "scan", LoadSettings(), needs_surface=False)
        assert [note.code for note in loaded.notes] == expected


@pytest.mark.parametrize("record", [keys(model=2), wkt('GEOGCS["WGS 84",UNIT["degree",0.0174]]')])
def test_degrees_are_refused(record: Any) -> None:
    with pytest.raises(errors.UnreadableFile, match="degrees of longitude"):
        unit_of_las([record])


@pytest.mark.parametrize(
    "record",
    [
        keys(unit=9003, vertical=9001),
        wkt(f'COMPD_CS["x",PROJCS["p",UNIT["US survey foot",0.3048006096012192]],VERT_CS["h",{METRE}]]'),
    ],
)
def test_two_units_are_refused(record: Any) -> None:
    with pytest.raises(errors.UnreadableFile, match="two units: us survey foot on the ground, meter for"):
        unit_of_las([record])


def test_fewer_points_than_announced_are_named_with_both_counts() -> None:
    with pytest.raises(errors.TruncatedFile, match="announces 400 points of 34 bytes, and has 398"):
        read(made()[:-60])
    # https://github.com/laspy/laspy/issues/212
    with pytest.raises(errors.TruncatedFile):
        read(made(compressed=True)[:-60])


@pytest.mark.parametrize("size", [4, 100, 226])
def test_a_cut_header_is_named(size: int) -> None:
    with pytest.raises(errors.TruncatedFile, match="header alone has 227"):
        read(made()[:size])


def test_more_records_than_the_file_can_hold_are_refused_at_once() -> None:
    for at in (100, 243):
        with pytest.raises(errors.TruncatedFile, match="variable length records"):
            read(patched(made("1.4", 6), at, "<I", 2**32 - 1))


def test_wrong_counts_and_scales_are_refused() -> None:
    with pytest.raises(errors.UnreadableFile, match="announces no points"):
        read(patched(made(), 107, "<I", 0))
    with pytest.raises(errors.MeshTooLarge, match="400 points; the limit is 399"):
        read(made(), max_points=399)
    with pytest.raises(errors.MeshTooLarge):
        read(patched(made(), 107, "<I", 2**32 - 1))
    for scale in (0.0, float("nan"), float("inf")):
        with pytest.raises(errors.UnreadableFile, match="scale factors"):
            read(patched(made(), 131, "<d", scale))


SMALL = [made("1.2", 3, records=(keys(model=1, unit=9001),)), made("1.4", 6, records=(wkt(UTM),))]
SMALL += [made("1.2", 3, compressed=True), made("1.4", 7, compressed=True)]


@settings(deadline=None)
@given(
    st.sampled_from(SMALL),
    st.integers(4, 700) | st.integers(700, 20_000),
    st.sampled_from([b"", b"\xff" * 4, b"\0" * 4, b"\xff" * 8, b"\x7f", b"\x01"]),
    st.integers(0, 9),
)
def test_a_changed_file_is_read_or_refused(whole: bytes, at: int, evil: bytes, lost: int) -> None:
    try:
        joined(read(whole[:at] + evil + whole[at + lost :]))
    except errors.PipelineError as refused:
        assert refused.reason and refused.remedy
