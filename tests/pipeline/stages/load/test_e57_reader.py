"""An E57 is read as the reference library (libE57, by `pye57`) writes and reads it, or refused by its reason.

Dialects are named with their public source.
"""

import re
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pye57
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pye57 import libe57
from scipy.spatial.transform import Rotation

from pipeline.core import errors
from pipeline.core.formats import Format, detect_format
from pipeline.core.mesh import FloatArray
from pipeline.core.mesh_file import MeshFile
from pipeline.core.settings import LoadSettings
from pipeline.stages.load import load
from pipeline.stages.load.contents import Contents, joined
from pipeline.stages.load.e57 import read_e57
from pipeline.stages.load.e57_pages import PAYLOAD_BYTES, checksums
from pipeline.stages.load.e57_points import unpacked

POINTS = np.random.default_rng(0).random((5000, 3)) * [4, 5, 6] - 2
QUATERNION = np.array([0.5, -0.5, 0.5, 0.5])
TRANSLATION = np.array([10.0, -20.0, 1.5])


def read(data: bytes, **limits: int) -> Contents:
    return read_e57(data, LoadSettings(**limits))


def cartesian(points: FloatArray) -> dict[str, FloatArray]:
    return dict(zip(("cartesianX", "cartesianY", "cartesianZ"), points.T.copy(), strict=True))


def written(folder: Path, *scans: dict[str, Any]) -> bytes:
    """Each scan: arguments of `write_scan_raw`."""
    path = folder / "made.e57"
    with pye57.E57(str(path), "w") as file:
        for scan in scans:
            file.write_scan_raw(**scan)
    return path.read_bytes()


def by_nodes(folder: Path, columns: dict[str, tuple[Any, FloatArray]], pose: bool = False) -> bytes:
    """One scan; columns : the node of the prototype as a function of the file, and the values, by name."""
    path = folder / "nodes.e57"
    with pye57.E57(str(path), "w") as file:
        image = file.image_file
        image.extensionsAdd("demo", "http://example.org/demo")
        prototype = libe57.StructureNode(image)
        buffers = libe57.VectorSourceDestBuffer()
        arrays = []
        for name, (node, values) in columns.items():
            prototype.set(name, node(image))
            arrays.append(np.ascontiguousarray(values))
            buffers.append(libe57.SourceDestBuffer(image, name, arrays[-1], len(values), True, True))
        points = libe57.CompressedVectorNode(image, prototype, libe57.VectorNode(image, True))
        scan = libe57.StructureNode(image)
        scan.set("guid", libe57.StringNode(image, "{1}"))
        file.data3d.append(scan)
        scan.set("points", points)
        writer = points.writer(buffers)
        writer.write(len(arrays[0]))
        writer.close()
    return path.read_bytes()


def with_xml(data: bytes, change: Any) -> bytes:
    """The XML section changed by `change`, of the same length, and the checksums made right again."""
    pages = np.frombuffer(data, dtype=np.uint8).reshape(-1, 1024)
    payload = pages[:, :PAYLOAD_BYTES].tobytes()
    at = payload.index(b"<?xml")
    (length,) = struct.unpack_from("<Q", payload, 32)
    xml = payload[at : at + length]
    new = change(xml)
    assert new != xml and len(new) <= length
    return repaged(payload[:at] + new.ljust(length, b" ") + payload[at + length :])


def repaged(payload: bytes) -> bytes:
    rows = np.frombuffer(payload, dtype=np.uint8).reshape(-1, PAYLOAD_BYTES)
    ends = checksums(rows).astype(">u4")[:, None].view(np.uint8)
    return np.hstack([rows, ends]).tobytes()


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    yield tmp_path_factory.mktemp("e57")


@pytest.fixture(scope="module")
def plain(folder: Path) -> bytes:
    return written(folder, {"data": cartesian(POINTS), "rotation": QUATERNION, "translation": TRANSLATION})


@pytest.fixture(scope="module")
def small(folder: Path) -> bytes:
    return written(folder, {"data": cartesian(POINTS[:40]), "rotation": QUATERNION})


def test_scans_with_poses_are_one_cloud_as_libe57_reads_it(folder: Path) -> None:
    state = (np.arange(len(POINTS)) % 10 == 0).astype(np.int8)
    data = written(
        folder,
        {
            "data": cartesian(POINTS) | {"cartesianInvalidState": state, "intensity": POINTS[:, 0].copy()},
            "name": "north",
            "rotation": QUATERNION,
            "translation": TRANSLATION,
        },
        {"data": cartesian(POINTS + 1), "name": "south", "translation": np.array([0.0, 3, 0])},
        {"data": cartesian(POINTS)},
    )
    assert detect_format(data[:4096], len(data)) == Format.E57
    contents = read(data)
    assert contents.unit == "meter"
    assert [body.name for body in contents.bodies] == ["north", "south", "Scan 2"]
    with pye57.E57(str(folder / "made.e57")) as file:
        for number, body in enumerate(contents.bodies):
            found = file.read_scan(number, ignore_missing_fields=True)
            np.testing.assert_allclose(body.vertices[:, 0], found["cartesianX"], atol=1e-9)
            np.testing.assert_allclose(body.vertices[:, 2], found["cartesianZ"], atol=1e-9)
    turn = Rotation.from_quat(QUATERNION[[1, 2, 3, 0]]).as_matrix()
    np.testing.assert_allclose(
        contents.bodies[0].vertices, POINTS[state == 0] @ turn.T + TRANSLATION, atol=1e-5
    )
    # the third scan has the identity as pose, which is no position
    north, south, nowhere = (body.scanner for body in contents.bodies)
    np.testing.assert_allclose([north, south], [TRANSLATION, [0, 3, 0]])
    assert nowhere is None
    assert [note.code for note in contents.notes] == ["points_without_position", "scanner_positions"]
    assert "500 marked as invalid or not finite of 15000" in contents.notes[0].detail
    assert "3 scans were put in one frame" in contents.notes[1].detail
    assert "(10, -20, 1.5), (0, 3, 0) m" in contents.notes[1].detail


@pytest.mark.parametrize(("away", "known"), [(20.0, True), (0.0, False)])
def test_the_loaded_mesh_is_in_mm_with_the_stations_that_lie_outside_it(
    folder: Path, away: float, known: bool
) -> None:
    data = {"data": cartesian(POINTS + away), "translation": TRANSLATION}
    (folder / "placed.e57").write_bytes(written(folder, data))
    loaded = load(MeshFile.of(folder / "placed.e57"), "scan", LoadSettings(), needs_surface=False)
    assert (loaded.unit, loaded.mm_per_unit) == ("m", 1000.0)
    assert np.ptp(loaded.mesh.vertices, axis=0).max() == pytest.approx(6000, rel=1e-3)
    assert (loaded.stations is not None) is known
    if loaded.stations is None:
        return
    np.testing.assert_allclose(loaded.stations.positions_mm, [TRANSLATION * 1000])
    np.testing.assert_array_equal(loaded.stations.of_vertex, np.zeros(len(loaded.mesh.vertices)))


@pytest.mark.parametrize(
    ("lowest", "highest"), [(-(2**20), 2**20), (0, 2**13 - 1), (-5_000_000, 7_000_001), (-(2**62), 2**62)]
)
def test_scaled_integers_of_any_width_are_read(folder: Path, lowest: int, highest: int) -> None:
    span = float(highest - lowest)
    scale, offset = 10.0 / span, 1.25
    values = POINTS[:, 0]

    def node(image: Any) -> Any:
        return libe57.ScaledIntegerNode(image, lowest, lowest, highest, scale, offset)

    stored = (values + 2) / 10 * span + lowest
    columns = dict.fromkeys(("cartesianX", "cartesianY", "cartesianZ"), (node, stored * scale + offset))
    vertices, _ = joined(read(by_nodes(folder, columns)))
    tolerance = max(scale, 1e-9 * abs(lowest * scale))
    np.testing.assert_allclose(vertices[:, 1], stored * scale + offset, atol=tolerance)


def test_fields_of_extensions_strings_and_constants_are_stepped_over(folder: Path) -> None:
    n = len(POINTS)
    single = lambda image: libe57.FloatNode(image, 0.0, libe57.E57_SINGLE, -1e6, 1e6)  # noqa: E731
    columns = {
        "rowIndex": (
            lambda image: libe57.IntegerNode(image, 0, 0, 1023),
            (np.arange(n) % 1000).astype(np.int16),
        ),
        "demo:cartesianX": (
            lambda image: libe57.IntegerNode(image, 0, 0, 5),
            (np.arange(n) % 5).astype(np.int8),
        ),
        "returnCount": (lambda image: libe57.IntegerNode(image, 1, 1, 1), np.ones(n, dtype=np.int8)),
        "cartesianX": (single, POINTS[:, 0].astype(np.float32)),
        "cartesianY": (single, POINTS[:, 1].astype(np.float32)),
        "cartesianZ": (lambda image: libe57.FloatNode(image, 0.0), POINTS[:, 2]),
    }
    contents = read(by_nodes(folder, columns))
    np.testing.assert_allclose(joined(contents)[0], POINTS, atol=1e-6)
    assert contents.bodies[0].scanner is None and contents.notes == ()


def test_spherical_coordinates_are_read(folder: Path) -> None:
    reach = np.linalg.norm(POINTS, axis=1)
    azimuth, elevation = np.arctan2(POINTS[:, 1], POINTS[:, 0]), np.arcsin(POINTS[:, 2] / reach)
    # https://github.com/asmaloney/libE57Format/issues/319: azimuth down to -2 pi
    azimuth[azimuth > 0] -= 2 * np.pi
    double = lambda image: libe57.FloatNode(image, 0.0)  # noqa: E731
    columns = {
        "sphericalRange": (double, reach),
        "sphericalAzimuth": (double, azimuth),
        "sphericalElevation": (double, elevation),
        "sphericalInvalidState": (
            lambda image: libe57.IntegerNode(image, 0, 0, 2),
            (np.arange(len(POINTS)) % 3).astype(np.int8),
        ),
    }
    vertices, _ = joined(read(by_nodes(folder, columns)))
    np.testing.assert_allclose(vertices, POINTS[::3], atol=1e-12)


def test_points_at_the_origin_of_their_scan_are_no_points(folder: Path) -> None:
    # https://github.com/CloudCompare/CloudCompare/issues/1374 (Leica Cyclone)
    empty = np.vstack([POINTS, np.zeros((700, 3))])
    contents = read(written(folder, {"data": cartesian(empty), "translation": TRANSLATION}))
    assert len(joined(contents)[0]) == len(POINTS)
    assert "700 exactly at the origin of their scan of 5700" in contents.notes[0].detail
    one = np.vstack([POINTS, np.zeros((1, 3))])
    assert len(joined(read(written(folder, {"data": cartesian(one)})))[0]) == len(one)


def test_a_rotation_of_zeros_is_none_and_is_said(plain: bytes) -> None:
    # https://github.com/CloudCompare/CloudCompare/pull/1690
    def zero(xml: bytes) -> bytes:
        return re.sub(rb"(<([wxyz]) type=\"Float\">)[-+0-9.eE]+(?=</\2>)", rb"\g<1>0", xml, count=4)

    contents = read(with_xml(plain, zero))
    np.testing.assert_allclose(joined(contents)[0], POINTS + TRANSLATION, atol=1e-5)
    assert "pose_without_rotation" in [note.code for note in contents.notes]


def test_a_pose_without_rotation_is_a_translation(plain: bytes) -> None:
    # https://github.com/davidcaron/pye57/pull/43
    contents = read(
        with_xml(plain, lambda xml: re.sub(rb"<rotation .*?</rotation>", b"", xml, flags=re.DOTALL))
    )
    np.testing.assert_allclose(joined(contents)[0], POINTS + TRANSLATION, atol=1e-5)
    assert [note.code for note in contents.notes] == ["scanner_positions"]


def test_only_invalid_points_are_refused(folder: Path) -> None:
    state = np.ones(len(POINTS), dtype=np.int8)
    state[0] = 0
    data = written(folder, {"data": cartesian(POINTS) | {"cartesianInvalidState": state}})
    assert len(joined(read(data))[0]) == 1
    nowhere = with_xml(data, lambda xml: xml.replace(b'recordCount="5000"', b'recordCount="0"'))
    with pytest.raises(errors.UnreadableFile, match="no valid points, of 0 in 1 scans"):
        read(nowhere)


@pytest.mark.parametrize("size", [8, 47, 48, 1024, 20_000])
def test_a_cut_file_is_named_with_its_sizes(plain: bytes, size: int) -> None:
    with pytest.raises(errors.TruncatedFile, match=r"has \d+"):
        read(plain[:size])


def test_a_changed_byte_is_found_by_the_checksum_of_its_page(plain: bytes) -> None:
    damaged = bytearray(plain)
    damaged[5 * 1024 + 77] ^= 4
    with pytest.raises(errors.UnreadableFile, match=r"checksum of page 5 \(bytes 5120"):
        read(bytes(damaged))


def test_counts_that_are_wrong_are_refused(plain: bytes) -> None:
    more = with_xml(plain, lambda xml: xml.replace(b'recordCount="5000"', b'recordCount="5009"'))
    with pytest.raises(errors.TruncatedFile, match=r"announces 5009 points, and has cartesian[XYZ] of 5000"):
        read(more)
    with pytest.raises(errors.MeshTooLarge, match="5000 points in 1 scans"):
        read(plain, max_points=4999)


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (lambda xml: xml.replace(b"<points", b"<pionts").replace(b"</points", b"</pionts"), "has no points"),
        (lambda xml: xml.replace(b"cartesianY", b"cartesianQ"), "no coordinates that are complete"),
        (lambda xml: re.sub(rb"<data3D.*</data3D>", b"", xml, flags=re.DOTALL), "has no scans"),
        (lambda xml: xml.replace(b"</e57Root>", b"</e57Toor>"), "XML section of the E57 is damaged"),
        (lambda xml: re.sub(rb"\?>", b"?><!DOCTYPE a>", xml, count=1).replace(b"  ", b""), "document type"),
        (lambda xml: re.sub(rb'fileOffset="\d+"', b'fileOffset="9"', xml), "section of type"),
    ],
)
def test_a_damaged_structure_is_named(plain: bytes, change: Any, reason: str) -> None:
    with pytest.raises(errors.UnreadableFile, match=reason):
        read(with_xml(plain, change))


def test_the_checksum_is_that_of_the_standard() -> None:
    # RFC 3720, appendix B.4: 32 bytes of zeros, of ones, and ascending
    rows = np.stack([np.zeros(32), np.full(32, 255), np.arange(32)]).astype(np.uint8)
    assert checksums(rows).tolist() == [0x8A9136AA, 0x62A8AB43, 0x46DD794E]


def test_a_signalling_nan_is_no_point(folder: Path) -> None:
    bits = np.full(10, 0x3F800000, dtype=np.uint32)
    bits[3] = 0x7FA00000
    single = lambda image: libe57.FloatNode(image, 0.0, libe57.E57_SINGLE)  # noqa: E731
    columns = {name: (single, bits.view(np.float32)) for name in ("cartesianX", "cartesianY", "cartesianZ")}
    assert len(joined(read(by_nodes(folder, columns)))[0]) == 9


@given(st.integers(0, 64), st.data())
def test_integers_of_any_width_are_unpacked(bits: int, data: st.DataObject) -> None:
    values = data.draw(st.lists(st.integers(0, 2**bits - 1), max_size=40))
    packed = sum(value << (bits * number) for number, value in enumerate(values))
    stream = packed.to_bytes((bits * len(values) + 7) // 8, "little")
    assert unpacked(stream, len(values), bits).tolist() == values


@given(
    st.booleans(),
    st.integers(0, 300) | st.integers(0, 2**20),
    st.sampled_from([b"\xff", b"\0\0\0\0", b"\xff" * 8, b"9", b"-", b"<", b"\x01"]),
)
def test_a_changed_payload_with_right_checksums_is_read_or_refused(
    small: bytes, in_xml: bool, at: int, evil: bytes
) -> None:
    rows = np.frombuffer(small, dtype=np.uint8).reshape(-1, 1024)
    payload = bytearray(rows[:, :PAYLOAD_BYTES].tobytes())
    first = payload.index(b"<?xml") if in_xml else 0
    place = first + at % (len(payload) - 9 - first)
    payload[place : place + len(evil)] = evil
    try:
        joined(read(repaged(bytes(payload))))
    except errors.PipelineError as refused:
        assert refused.reason and refused.remedy
