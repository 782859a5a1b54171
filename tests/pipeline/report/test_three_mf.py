"""`aligned.3mf` holds the aligned scan: read back it is the same vertices in mm, in the colours of the
other files.
"""

import zipfile
from pathlib import Path

import numpy as np
import pytest
import trimesh
from lxml import etree

import pipeline
from pipeline import MeshFile
from pipeline.core.mesh import Mesh
from pipeline.core.settings import LoadSettings
from pipeline.report import three_mf
from pipeline.report.artifacts import _write_three_mf
from pipeline.report.colormap import ColourScale
from pipeline.stages.deviation import Deviations
from pipeline.stages.load import load
from tests.support.meshes import blob_stl
from tests.support.settings import FAST as SMALL
from tests.support.shapes import grid_plane, icosphere, motion


def read(path: Path) -> Mesh:
    found = load(MeshFile(path), "scan", LoadSettings(), needs_surface=True)
    assert (found.format, found.unit, found.mm_per_unit) == ("3mf", "mm", 1.0)
    return found.mesh


def painted(mesh: Mesh) -> np.ndarray:
    low = mesh.vertices.min(axis=0)
    return (mesh.vertices - low) / np.maximum(np.ptp(mesh.vertices, axis=0), 1e-9)


@pytest.mark.parametrize("mesh", [icosphere(10.0, 3).moved(motion(5)), grid_plane()], ids=["closed", "open"])
def test_it_is_read_back_to_the_last_digit_with_its_unit(tmp_path: Path, mesh: Mesh) -> None:
    three_mf.write(tmp_path / "a.3mf", mesh, painted(mesh), "part")
    back = read(tmp_path / "a.3mf")
    assert np.array_equal(back.vertices, mesh.vertices) and np.array_equal(back.faces, mesh.faces)


def test_each_corner_has_the_colour_of_its_vertex(tmp_path: Path) -> None:
    mesh = icosphere(10.0, 2)
    three_mf.write(tmp_path / "a.3mf", mesh, painted(mesh), "part")
    with zipfile.ZipFile(tmp_path / "a.3mf") as archive:
        model = etree.fromstring(archive.read("3D/3dmodel.model"))
    space = {"c": three_mf.CORE, "m": three_mf.MATERIAL}
    colours = [each.get("color") for each in model.iterfind(".//m:color", space)]
    assert len(set(colours)) == len(colours)
    rgb = np.array([[int(colour[k : k + 2], 16) for k in (1, 3, 5)] for colour in colours])
    triangles = list(model.iterfind(".//c:triangle", space))
    corners = np.array([[int(each.get(f"p{k}")) for k in (1, 2, 3)] for each in triangles])
    assert np.array_equal(rgb[corners], np.rint(255 * painted(mesh)).astype(int)[mesh.faces])
    (thing,) = model.iterfind(".//c:object", space)
    (group,) = model.iterfind(".//m:colorgroup", space)
    assert thing.get("pid") == group.get("id") and thing.get("type") == "surface"
    assert model.get("unit") == "millimeter"


def test_the_same_bytes_each_time(tmp_path: Path) -> None:
    mesh = icosphere(10.0, 2)
    for name in ("a", "b"):
        three_mf.write(tmp_path / name, mesh, painted(mesh), "part")
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()


def test_a_job_that_is_asked_leaves_the_aligned_scan(tmp_path: Path) -> None:
    (tmp_path / "d.stl").write_bytes(blob_stl())
    (tmp_path / "s.stl").write_bytes(blob_stl(23, 37, turn_deg=25.0, shift_mm=(4.0, -3.0, 2.0)))
    settings = pipeline.Settings.model_validate({**SMALL, "report": {"three_mf": True}})
    result = pipeline.register(
        tmp_path / "d.stl", tmp_path / "s.stl", settings=settings, out=tmp_path / "out"
    )
    assert (
        sorted(path.name for path in (tmp_path / "out").iterdir()) == result.files
        and "aligned.3mf" in result.files
    )
    back, aligned = (
        read(tmp_path / "out" / "aligned.3mf"),
        trimesh.load(tmp_path / "out" / "aligned.ply", process=False),
    )
    assert np.array_equal(back.vertices, aligned.vertices) and np.array_equal(back.faces, aligned.faces)
    assert not pipeline.Settings().report.three_mf


def test_points_have_no_3mf_and_the_job_says_so(tmp_path: Path) -> None:
    cloud = Mesh(icosphere(5.0, 2).vertices)
    n = len(cloud.vertices)
    deviations = Deviations(np.zeros(n), np.ones(n, dtype=np.bool_), None)
    found = _write_three_mf(tmp_path, cloud, deviations, ColourScale(1.0, None))
    assert found.files == () and [note.code for note in found.notes] == ["no_three_mf"]
    assert not list(tmp_path.iterdir())
