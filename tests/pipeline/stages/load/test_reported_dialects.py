"""Files that users of other programs could not open, or that were read wrongly, as their issues tell.

Every file is made here after the description; nothing is copied. Each case names its issue.
"""

import json
import struct
from pathlib import Path

import numpy as np
import pytest

from pipeline.core import errors
from pipeline.core.mesh_file import MeshFile
from pipeline.core.settings import LoadSettings
from pipeline.stages.load import Loaded, load
from tests.pipeline.stages.load.test_gltf_reader import Maker
from tests.pipeline.stages.load.test_three_mf_reader import ROOT, model, package, thing

POINTS = np.random.default_rng(0).normal(size=(60, 3))
SQUARE = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n"


def read(folder: Path, name: str, data: str | bytes) -> Loaded:
    path = folder / name
    path.write_bytes(data.encode() if isinstance(data, str) else data)
    return load(MeshFile.of(path), "scan", LoadSettings(), needs_surface=False)


def rows(table: np.ndarray, more: str = "") -> str:
    return "".join(" ".join(f"{value:.6f}" for value in row) + more + "\n" for row in table)


def glb_of_json(document: bytes) -> bytes:
    """A GLB with its JSON chunk only."""
    document += b" " * (-len(document) % 4)
    body = struct.pack("<I4s", len(document), b"JSON") + document
    return struct.pack("<4sII", b"glTF", 2, 12 + len(body)) + body


@pytest.mark.parametrize(
    "heading", ["", "//" + " ".join(["X", "Y", "Z", *(f"f{n}" for n in range(600))]) + "\n"]
)
def test_points_with_hundreds_of_columns(tmp_path: Path, heading: str) -> None:
    # https://github.com/CloudCompare/CloudCompare/issues/2178: a row is longer than what tells the format
    table = np.hstack([POINTS, np.random.default_rng(1).normal(size=(60, 600))])
    loaded = read(tmp_path, "wide.xyz", heading + rows(table))
    np.testing.assert_allclose(loaded.mesh.vertices, POINTS, atol=1e-6)


def test_the_name_of_a_cloud_in_a_comment_above_the_heading(tmp_path: Path) -> None:
    # https://github.com/CloudCompare/CloudCompare/issues/394
    loaded = read(tmp_path, "named.asc", "// subCloud_1\n// X Y Z\n" + rows(POINTS))
    np.testing.assert_allclose(loaded.mesh.vertices, POINTS, atol=1e-6)


@pytest.mark.parametrize("first", ["", "x y z intensity red green blue\n"])
def test_a_pts_without_its_count(tmp_path: Path, first: str) -> None:
    # https://github.com/isl-org/Open3D/issues/913 (ReCap), https://github.com/daavoo/pyntcloud/issues/305
    loaded = read(tmp_path, "recap.pts", first + rows(POINTS, " 0.372 117 130 149"))
    np.testing.assert_allclose(loaded.mesh.vertices, POINTS, atol=1e-6)


GRIDS = {
    "esri.asc": "ncols 3\nnrows 20\nxllcorner 100.0\nyllcorner 200.0\ncellsize 0.5\nNODATA_value -9999\n",
    "surfer.grd": "DSAA\n3 20\n0 2\n0 19\n-3 3\n",
}


@pytest.mark.parametrize("name", GRIDS)
def test_a_grid_of_heights_is_no_cloud_of_its_rows(tmp_path: Path, name: str) -> None:
    # https://github.com/CloudCompare/CloudCompare/issues/2225: the ending is that of points
    with pytest.raises(errors.UnknownFormat, match="grid of heights; write its points as x y z"):
        read(tmp_path, name, GRIDS[name] + rows(POINTS[:20]))


def test_another_format_that_is_called_obj_is_named(tmp_path: Path) -> None:
    # https://github.com/BIC-MNI/minc-toolkit-v2/issues/65
    text = (
        "P 0.3 0.3 0.4 10 1 4\n" + rows(POINTS[:4]) + "\n" + rows(POINTS[:4]) + "\n4\n0 1 1 1 1\n\n3 6 9 12\n"
    )
    with pytest.raises(errors.UnknownFormat, match="MNI tools, which is another OBJ; convert it to PLY"):
        read(tmp_path, "brain.obj", text + "\n0 1 2 0 1 3 0 2 3 1 2 3\n")


def test_an_off_that_is_called_obj_is_read_as_off(tmp_path: Path) -> None:
    # https://github.com/eth-igl/GP2021-Assignments/issues/60
    loaded = read(tmp_path, "eight.obj", "OFF\n4 1 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3\n")
    assert (loaded.format, len(loaded.mesh.faces)) == ("off", 2)


OBJ = {
    # https://github.com/mikedh/trimesh/issues/1829
    "names that look like faces": "g An f Three Other Thing\no v 1 2 3\nusemtl f 1 2 3\n"
    + SQUARE
    + "f 1 2 3 4\n",
    # https://github.com/mikedh/trimesh/issues/1079
    "indices of texture coordinates that are not there": SQUARE + "vn 0 0 1\nf 1/1/1 2/2/1 3/3/1 4/4/1\n",
    # https://github.com/fougue/mayo/issues/341 (Wings3D)
    "two slashes and nothing after them": SQUARE + "f 1// 2// 3// 4//\n",
    # https://github.com/mikedh/trimesh/issues/2085
    "colours at some vertices only": SQUARE.replace("1 0 0\n", "1 0 0 0.5 0.4 0.3\n") + "f 1 2 3 4\n",
    # https://github.com/cnr-isti-vclab/meshlab/issues/1270
    "normals between the vertices": SQUARE.replace("\n", " .5 .4 .3\nvn 0 0 1\n")
    + "f 1//1 2//2 3//3 4//4 \n",
}


@pytest.mark.parametrize("case", OBJ)
def test_an_obj_as_others_write_it(tmp_path: Path, case: str) -> None:
    loaded = read(tmp_path, "square.obj", OBJ[case])
    corners = loaded.mesh.vertices[loaded.mesh.faces]
    assert loaded.mesh.face_areas_mm2().sum() == pytest.approx(1.0)
    np.testing.assert_array_equal(corners.reshape(-1, 3).min(axis=0), [0, 0, 0])
    np.testing.assert_array_equal(corners.reshape(-1, 3).max(axis=0), [1, 1, 0])
    assert loaded.notes == ()


def test_a_ply_with_a_comment_before_its_format(tmp_path: Path) -> None:
    # https://github.com/nschloe/meshio/issues/906
    head = "ply\ncomment Created by meshio\nformat ascii 1.0\nelement vertex 3\n"
    head += "".join(f"property double {axis}\n" for axis in "xyz")
    head += "element face 1\nproperty list uint8 int32 vertex_indices\nend_header\n"
    assert len(read(tmp_path, "made.ply", head + "0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n").mesh.faces) == 1


def test_a_glb_with_its_buffer_as_base64(tmp_path: Path) -> None:
    # https://github.com/najadojo/gltf-import-export/issues/7 (Blender 2.79)
    loaded = read(tmp_path, "cubes.glb", glb_of_json(Maker().square().gltf()))
    assert len(loaded.mesh.faces) == 2


@pytest.mark.parametrize("padding", [-3, -1, 1, 3])
def test_a_glb_whose_length_counts_padding_wrongly(tmp_path: Path, padding: int) -> None:
    # https://github.com/assimp/assimp/issues/3176: chunks are whole, the sum in the head is not theirs
    data = Maker().square().glb()
    changed = data[:8] + struct.pack("<I", len(data) + padding) + data[12:]
    assert len(read(tmp_path, "made.glb", changed).mesh.faces) == 2
    for cut in range(1, 12):
        with pytest.raises(errors.TruncatedFile):
            read(tmp_path, "cut.glb", data[:-cut])


def test_a_gltf_with_pictures_that_are_nowhere_and_a_primitive_without_positions(tmp_path: Path) -> None:
    # https://github.com/assimp/assimp/issues/5646, https://github.com/assimp/assimp/issues/5868
    made = Maker().square()
    made.json["images"], made.json["textures"] = [{}], [{"source": 0}]
    made.json["meshes"].append({"primitives": [{"attributes": {"NORMAL": 0}}]})
    made.json["nodes"].append({"mesh": 1})
    made.json["scenes"] = [{"nodes": [0, 1]}]
    loaded = read(tmp_path, "made.glb", made.glb())
    assert len(loaded.mesh.faces) == 2
    assert [note.code for note in loaded.notes] == ["left_out_of_gltf"]


def test_wrong_bounds_of_an_accessor_change_nothing(tmp_path: Path) -> None:
    # https://github.com/mikedh/trimesh/issues/1062: errors of the validator that no reader depends on
    document = json.loads(Maker().square().gltf())
    document["accessors"][0] |= {"min": [9, 9, 9], "max": [-9, -9, -9]}
    assert len(read(tmp_path, "made.gltf", json.dumps(document)).mesh.faces) == 2


@pytest.mark.parametrize(
    "ghost",
    [
        "<mesh><vertices></vertices><triangles></triangles></mesh>",
        '<mesh><vertices><vertex x="0" y="0" z="0"/></vertices></mesh>',
        "",
    ],
)
def test_a_body_without_content_on_the_plate_is_named(tmp_path: Path, ghost: str) -> None:
    # https://github.com/prusa3d/PrusaSlicer/issues/13209 and 14279 (Fusion)
    objects = thing(1) + f'<object id="9" type="model" name="ghost">{ghost}</object>'
    build = '<item objectid="9"/><item objectid="1"/>'
    loaded = read(tmp_path, "part.3mf", package({ROOT: model(objects, build)}))
    assert len(loaded.mesh.faces) == 12
    (note,) = loaded.notes
    assert note.code == "left_out_of_3mf" and "1 build item without triangles (ghost" in note.detail
