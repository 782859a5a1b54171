"""Every format arrives in mm; every bad file is refused with its name, its fault and a remedy."""

import io
import struct
import zipfile
from pathlib import Path

import numpy as np
import pytest
import trimesh

import pipeline
from pipeline import MeshFile
from pipeline.core import errors
from pipeline.core.settings import LoadSettings, Unit
from pipeline.stages.load import Loaded, load
from tests.support import shapes

BOX = shapes.box((1.0, 2.0, 3.0))
STL_HEAD = b"\0" * 80
PLY_HEAD = (
    b"ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
    b"element face 2\nproperty list uchar int vertex_indices\nend_header\n"
)
PLY_POINTS = b"0 0 0\n1 0 0\n0 1 0\n0 0 1\n"
ASCII_FACET = b"facet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\n"


def read(
    data: bytes, tmp_path: Path, name: str, unit: Unit = "auto", *, needs_surface: bool = True
) -> Loaded:
    path = tmp_path / name
    path.write_bytes(data)
    return load(MeshFile(path, unit=unit), "design", LoadSettings(), needs_surface=needs_surface)


def exported(kind: str) -> bytes:
    mesh = trimesh.Trimesh(BOX.vertices, BOX.faces, process=False)
    if kind == "3mf":
        scene = trimesh.Scene()
        scene.add_geometry(mesh, transform=trimesh.transformations.translation_matrix([5, 0, 0]))
        return trimesh.exchange.threemf.export_3MF(scene)
    data = mesh.export(file_type=kind)
    return data if isinstance(data, bytes) else data.encode()


@pytest.mark.parametrize("kind", ["stl", "stl_ascii", "ply", "obj", "off"])
def test_each_format_gives_the_same_triangles(kind: str, tmp_path: Path) -> None:
    loaded = read(exported(kind), tmp_path, f"part.{kind.removesuffix('_ascii')}")
    corners = loaded.mesh.vertices[loaded.mesh.faces]
    np.testing.assert_allclose(corners, BOX.vertices[BOX.faces], atol=1e-6)
    assert (loaded.unit, loaded.mm_per_unit) == ("mm", 1.0)


def test_glb_is_in_metres(tmp_path: Path) -> None:
    loaded = read(exported("glb"), tmp_path, "part.glb")
    np.testing.assert_allclose(np.ptp(loaded.mesh.vertices, axis=0), [1000, 2000, 3000], rtol=1e-6)
    assert (loaded.unit, loaded.mm_per_unit) == ("m", 1000.0)


def test_3mf_units_and_build_transforms_are_applied(tmp_path: Path) -> None:
    data = exported("3mf")
    declared = with_unit(data, "inch")
    loaded = read(declared, tmp_path, "part.3mf")
    np.testing.assert_allclose(loaded.mesh.vertices.min(axis=0), [5 * 25.4, 0, 0], atol=1e-4)
    np.testing.assert_allclose(np.ptp(loaded.mesh.vertices, axis=0), [25.4, 50.8, 76.2], atol=1e-4)
    assert loaded.unit == "inch"


def with_unit(data: bytes, unit: str) -> bytes:
    out = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(data)) as old, zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as new:
        for entry in old.infolist():
            content = old.read(entry)
            if entry.filename.endswith(".model"):
                content = content.replace(b'unit="millimeter"', f'unit="{unit}"'.encode())
                assert f'unit="{unit}"'.encode() in content
            new.writestr(entry.filename, content)
    return out.getvalue()


@pytest.mark.parametrize(("unit", "factor"), [("mm", 1.0), ("cm", 10.0), ("m", 1000.0), ("inch", 25.4)])
def test_the_users_unit_wins(unit: Unit, factor: float, tmp_path: Path) -> None:
    loaded = read(exported("stl"), tmp_path, "part.stl", unit)
    np.testing.assert_allclose(np.ptp(loaded.mesh.vertices, axis=0), np.array([1, 2, 3]) * factor, rtol=1e-6)


@pytest.mark.parametrize(
    ("text", "count"),
    [
        (b"0 0 0\n1 0 0\n0 1 0\n", 3),
        (b"x,y,z,intensity\n0,0,0,7\n1,0,0,8\n0,1,0,9\n", 3),
        (b"# scanner 5\n0;0;0\n1;0;0\n", 2),
    ],
    ids=["spaces", "csv with heading", "semicolons"],
)
def test_xyz_points_are_read_for_a_scan(text: bytes, count: int, tmp_path: Path) -> None:
    loaded = read(text, tmp_path, "scan.xyz", needs_surface=False)
    assert loaded.mesh.is_cloud and len(loaded.mesh.vertices) == count


def zip_bomb() -> bytes:
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("3D/3dmodel.model", b"0" * 50_000_000)
    return out.getvalue()


BAD: dict[str, tuple[bytes, str, type[pipeline.PipelineError], str]] = {
    "empty": (b"", "a.stl", errors.EmptyFile, "empty"),
    "text": (b"hello, this is a letter\n", "a.stl", errors.UnknownFormat, ".stl"),
    "a picture": (b"\x89PNG\r\n\x1a\n" + b"\0" * 200, "a.png", errors.UnknownFormat, "PNG picture"),
    "half an STL header": (b"\0" * 40, "a.stl", errors.TruncatedFile, "84 bytes"),
    "four billion triangles": (
        STL_HEAD + struct.pack("<I", 0xFFFFFFFF),
        "a.stl",
        errors.TruncatedFile,
        "4294967295 triangles",
    ),
    "cut binary STL": (exported("stl")[:-30], "a.stl", errors.TruncatedFile, "12 triangles"),
    "cut ASCII STL": (b"solid a\n" + ASCII_FACET + ASCII_FACET[:60], "a.stl", errors.PipelineError, "STL"),
    "cut binary PLY": (exported("ply")[:-7], "a.ply", errors.TruncatedFile, "ply"),
    "cut ASCII PLY": (
        PLY_HEAD + PLY_POINTS + b"3 0 1 2\n",
        "a.ply",
        errors.TruncatedFile,
        "2 face rows and has 1",
    ),
    "cut OFF": (b"OFF\n3 4 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n", "a.off", errors.TruncatedFile, "4 faces"),
    "cut GLB": (exported("glb")[:-40], "a.glb", errors.TruncatedFile, "glb"),
    "NaN": (
        PLY_HEAD + PLY_POINTS.replace(b"1 0 0", b"nan 0 0") + b"3 0 1 2\n3 0 2 3\n",
        "a.ply",
        errors.NotFinite,
        "1 of 4 vertices",
    ),
    "stray point": (b"0 0 0\n1 1 2\n3 4 1e9\n", "a.xyz", errors.CoordinateOutOfRange, "1 of 3"),
    "NaN points": (b"0 0 0\nnan 1 2\n3 4 5\n", "a.xyz", errors.NotFinite, "1 of 3"),
    "index out of range (PLY)": (
        PLY_HEAD + PLY_POINTS + b"3 0 1 2\n3 0 2 9\n",
        "a.ply",
        errors.IndexOutOfRange,
        "vertex 9",
    ),
    "negative index (PLY)": (
        PLY_HEAD + PLY_POINTS + b"3 0 1 2\n3 0 2 -1\n",
        "a.ply",
        errors.IndexOutOfRange,
        "-1",
    ),
    "index out of range (OBJ)": (
        b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n",
        "a.obj",
        errors.IndexOutOfRange,
        "obj",
    ),
    "index out of range (OFF)": (
        b"OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 7\n",
        "a.off",
        errors.IndexOutOfRange,
        "off",
    ),
    "points as a design": (b"0 0 0\n1 0 0\n0 1 0\n", "a.xyz", errors.NoSurface, "3 points and no triangles"),
    "OBJ without faces": (b"v 0 0 0\nv 1 0 0\nv 0 1 0\n", "a.obj", errors.NoSurface, "no triangles"),
    "not a zip": (b"PK\x03\x04" + b"\0" * 100, "a.3mf", errors.UnreadableFile, "zip"),
    "zip bomb": (zip_bomb(), "a.3mf", errors.MeshTooLarge, "unpacks to 50000000"),
    "empty 3MF": (
        with_unit(exported("3mf"), "millimeter")[:-10],
        "a.3mf",
        errors.UnreadableFile,
        "zip",
    ),
    "words in XYZ": (b"0 0 0\n1 1 1\n2 2 two\n", "a.xyz", errors.PipelineError, ""),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_file_is_refused_with_its_fault_and_a_remedy(case: str, tmp_path: Path) -> None:
    data, name, expected, words = BAD[case]
    with pytest.raises(expected) as caught:
        read(data, tmp_path, name)
    error = caught.value
    assert isinstance(error, errors.PipelineError)
    assert error.mesh == "design" and error.detail.startswith("design: ")
    assert words in error.reason
    assert len(error.remedy) > 10


def test_unit_that_is_none_is_an_error_not_a_guess(tmp_path: Path) -> None:
    with pytest.raises(errors.UnitUnknown, match="furlong"):
        read(with_unit(exported("3mf"), "furlong"), tmp_path, "part.3mf")


def test_missing_file_is_a_clear_error(tmp_path: Path) -> None:
    with pytest.raises(errors.UnreadableFile, match=r"nowhere\.stl cannot be read"):
        load(MeshFile(tmp_path / "nowhere.stl"), "scan", LoadSettings(), needs_surface=False)


def test_too_many_triangles_are_refused_before_parsing(tmp_path: Path) -> None:
    data = STL_HEAD + struct.pack("<I", 1000) + b"\0" * 50 * 1000
    path = tmp_path / "a.stl"
    path.write_bytes(data)
    with pytest.raises(errors.MeshTooLarge, match="1000 triangles; the limit is 999"):
        load(MeshFile(path), "design", LoadSettings(max_faces=999), needs_surface=True)
