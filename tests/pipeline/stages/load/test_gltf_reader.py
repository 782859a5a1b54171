"""A glTF 2.0 gives what its default scene shows, in metres, or is refused with accessor, node or extension.

All files are made here. Each form is named with its source: a section of the glTF 2.0 specification
(https://registry.khronos.org/glTF/specs/2.0/glTF-2.0.html), an extension, or a public issue.
"""

import base64
import json
import struct
from typing import Any

import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from pipeline.core import errors
from pipeline.core.formats import Format, detect_format
from pipeline.core.mesh import FloatArray
from pipeline.core.settings import LoadSettings
from pipeline.stages.load.contents import Contents, joined
from pipeline.stages.load.gltf import read_glb
from tests.support import shapes

BOX = shapes.box((1.0, 2.0, 3.0))
CORNERS = np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)], dtype=float)
HALVES = [[0, 1, 2], [0, 2, 3]]
CODES = {"i1": 5120, "u1": 5121, "i2": 5122, "u2": 5123, "u4": 5125, "f4": 5126}
KINDS = {1: "SCALAR", 3: "VEC3", 4: "VEC4", 16: "MAT4"}


class Maker:
    """Makes a file, array after array."""

    def __init__(self) -> None:
        self.data = b""
        self.json: dict[str, Any] = {
            "asset": {"version": "2.0"},
            "scene": 0,
            "scenes": [{"nodes": [0]}],
            "nodes": [{"mesh": 0}],
            "meshes": [{"primitives": []}],
            "accessors": [],
            "bufferViews": [],
            "buffers": [{"byteLength": 0}],
        }

    def view(self, data: bytes, **more: Any) -> int:
        self.data += b"\0" * (-len(self.data) % 4)
        self.json["bufferViews"].append(
            {"buffer": 0, "byteOffset": len(self.data), "byteLength": len(data)} | more
        )
        self.data += data
        return len(self.json["bufferViews"]) - 1

    def array(self, values: Any, kind: str = "f4", **more: Any) -> int:
        table = np.asarray(values).astype("<" + kind)
        table = table.reshape(len(table), -1)
        accessor = {
            "bufferView": self.view(table.tobytes()),
            "componentType": CODES[kind],
            "count": len(table),
            "type": KINDS[table.shape[1]],
        }
        self.json["accessors"].append(accessor | more)
        return len(self.json["accessors"]) - 1

    def primitive(self, positions: int, indices: int | None = None, **more: Any) -> "Maker":
        made = {"attributes": {"POSITION": positions}} | more
        self.json["meshes"][-1]["primitives"].append(made | ({} if indices is None else {"indices": indices}))
        return self

    def square(self, **more: Any) -> "Maker":
        return self.primitive(self.array(CORNERS), self.array(np.ravel(HALVES), "u2"), **more)

    def node(self, **more: Any) -> "Maker":
        self.json["nodes"][0] |= more
        return self

    def glb(self) -> bytes:
        self.json["buffers"][0]["byteLength"] = len(self.data)
        text = json.dumps(self.json).encode()
        return glb(text, self.data)

    def gltf(self) -> bytes:
        self.json["buffers"][0] = {
            "byteLength": len(self.data),
            "uri": "data:application/octet-stream;base64," + base64.b64encode(self.data).decode(),
        }
        return json.dumps(self.json, indent=1).encode()


def glb(text: bytes, data: bytes, version: int = 2) -> bytes:
    text += b" " * (-len(text) % 4)
    data += b"\0" * (-len(data) % 4)
    body = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(data), b"BIN\0") + data
    return struct.pack("<4sII", b"glTF", version, 12 + len(body)) + body


def read(made: Maker | bytes, **settings: int) -> Contents:
    return read_glb(made if isinstance(made, bytes) else made.glb(), LoadSettings(**settings))


def corners(made: Maker | bytes) -> FloatArray:
    """(m, 3, 3) corners of the triangles."""
    contents = read(made)
    assert contents.unit == "meter"
    vertices, faces = joined(contents)
    return vertices[faces]


SQUARE = CORNERS[np.array(HALVES)]


def indexed(kind: str) -> Maker:
    made = Maker()
    return made.primitive(made.array(CORNERS), made.array(np.ravel(HALVES), kind))


def quantized(kind: str, *, normalized: bool) -> Maker:
    """KHR_mesh_quantization: integers, scaled by the node; padded to 4 bytes (section 3.6.2.4)."""
    made, size = Maker(), int(kind[1])
    top = np.iinfo(kind).max if normalized else 1
    table = np.zeros((4, 4), dtype="<" + kind)
    table[:, :3] = CORNERS * top
    view = made.view(table.tobytes(), byteStride=4 * size)
    made.json["accessors"].append(
        {
            "bufferView": view,
            "componentType": CODES[kind],
            "count": 4,
            "type": "VEC3",
            "normalized": normalized,
        }
    )
    made.json["extensionsRequired"] = made.json["extensionsUsed"] = ["KHR_mesh_quantization"]
    return made.primitive(0, made.array(np.ravel(HALVES), "u1"))


def interleaved() -> Maker:
    """Section 3.6.2.4: positions and normals in one view, with a stride and an offset."""
    made = Maker()
    table = np.hstack([np.full((4, 3), 9.0), CORNERS]).astype("<f4")
    made.view(table.tobytes(), byteStride=24)
    made.json["accessors"].append(
        {"bufferView": 0, "byteOffset": 12, "componentType": 5126, "count": 4, "type": "VEC3"}
    )
    return made.primitive(0, made.array(np.ravel(HALVES), "u2"))


def sparse(*, base: bool) -> Maker:
    """Section 3.6.2.3: some values replaced; without a view the others are 0."""
    made = Maker()
    old = CORNERS.copy()
    old[1:] = 7.0
    changed = made.view(np.array([1, 2, 3], dtype="<u2").tobytes())
    values = made.view(CORNERS[1:].astype("<f4").tobytes())
    accessor = {
        "componentType": 5126,
        "count": 4,
        "type": "VEC3",
        "sparse": {
            "count": 3,
            "indices": {"bufferView": changed, "componentType": 5123},
            "values": {"bufferView": values},
        },
    }
    if base:
        accessor["bufferView"] = made.view(old.astype("<f4").tobytes())
    made.json["accessors"].append(accessor)
    return made.primitive(0, made.array(np.ravel(HALVES), "u2"))


def without_indices() -> Maker:
    made = Maker()
    return made.primitive(made.array(SQUARE.reshape(-1, 3)))


def in_mode(mode: int, order: list[int]) -> Maker:
    made = Maker()
    return made.primitive(made.array(CORNERS), made.array(order, "u1"), mode=mode)


def shared_positions() -> Maker:
    made = Maker()
    positions = made.array(CORNERS)
    for face in HALVES:
        made.primitive(positions, made.array(face, "u2"))
    return made


def without(*keys: str) -> Maker:
    made = Maker().square()
    for key in keys:
        del made.json[key]
    return made


def harmless_extension() -> Maker:
    made = Maker().square()
    made.json["extensionsRequired"] = ["KHR_materials_unlit", "KHR_texture_transform", "EXT_texture_webp"]
    return made


def draco_with_fallback() -> Maker:
    extension = {"KHR_draco_mesh_compression": {"bufferView": 0, "attributes": {"POSITION": 0}}}
    made = Maker().square(extensions=extension)
    made.json["extensionsUsed"] = ["KHR_draco_mesh_compression"]
    return made


def meshopt_with_data() -> Maker:
    made = Maker().square()
    for view in made.json["bufferViews"]:
        view["extensions"] = {
            "EXT_meshopt_compression": {"buffer": 0, "byteLength": 4, "count": 1, "mode": "X"}
        }
    made.json["extensionsUsed"] = ["EXT_meshopt_compression"]
    return made


def padded() -> bytes:
    """JSON padded by zeros, and a chunk of another kind (section 4.4.3)."""
    made = Maker().square()
    made.json["buffers"][0]["byteLength"] = len(made.data)
    text = json.dumps(made.json).encode()
    data = glb(text + b"\0" * (-len(text) % 4), made.data)
    extra = struct.pack("<I4s", 4, b"XYZ1") + b"\1\2\3\4"
    return data[:8] + struct.pack("<I", len(data) + len(extra)) + data[12:] + extra


#: Each gives the square of two triangles.
FORMS: dict[str, Maker | bytes] = {
    "float positions, u2 indices": Maker().square(),
    "u1 indices": indexed("u1"),
    "u4 indices": indexed("u4"),
    "no indices (3.7.2.1)": without_indices(),
    "interleaved": interleaved(),
    "sparse": sparse(base=True),
    "sparse on zeros": sparse(base=False),
    # https://github.com/BabylonJS/Babylon-Lite/pull/393, https://github.com/zeux/meshoptimizer/issues/422
    **{
        f"quantized {kind}, {normalized=}": quantized(kind, normalized=normalized)
        for kind in ("i1", "u1", "i2", "u2")
        for normalized in (True, False)
    },
    "strip (3.7.2.1)": in_mode(5, [1, 2, 0, 3]),
    "strip with a connection": in_mode(5, [1, 2, 0, 0, 0, 2, 3]),
    "fan (3.7.2.1)": in_mode(6, [0, 1, 2, 3]),
    "positions shared by primitives": shared_positions(),
    "no `scene`": without("scene"),
    "no scenes": without("scene", "scenes"),
    "no nodes": without("scene", "scenes", "nodes"),
    "extensions of appearance": harmless_extension(),
    "Draco with a fallback": draco_with_fallback(),
    "meshopt with a fallback": meshopt_with_data(),
    "JSON with embedded buffer": Maker().square().gltf(),
    "JSON with byte order mark": b"\xef\xbb\xbf" + Maker().square().gltf(),
    "padding and further chunks": padded(),
    "bytes after the GLB": Maker().square().glb() + b"\0" * 7,
}


@pytest.mark.parametrize("form", FORMS)
def test_each_form_gives_the_square(form: str) -> None:
    data = FORMS[form] if isinstance(FORMS[form], bytes) else FORMS[form].glb()  # type: ignore[union-attr]
    assert isinstance(data, bytes)
    assert detect_format(data[:4096], len(data)) is Format.GLB
    triangles = corners(data)
    # a strip or fan may start each triangle at another corner
    first = np.array([np.lexsort(triangle.T[::-1])[0] for triangle in triangles])
    turned = [np.roll(triangle, -start, axis=0) for triangle, start in zip(triangles, first, strict=True)]
    expected = sorted(SQUARE.tolist())
    np.testing.assert_allclose(sorted(np.array(turned).tolist()), expected, atol=1e-7)
    assert read(data).notes == ()


def test_order_of_vertices_and_faces_is_that_of_the_file() -> None:
    made = Maker()
    made.primitive(made.array(BOX.vertices), made.array(BOX.faces.ravel(), "u4"))
    vertices, faces = joined(read(made))
    np.testing.assert_array_equal(vertices, BOX.vertices)
    np.testing.assert_array_equal(faces, BOX.faces)


@pytest.mark.parametrize(("kind", "low"), [("i1", -128), ("i2", -32768)])
def test_the_most_negative_integer_is_minus_one(kind: str, low: int) -> None:
    # section 3.6.2.2
    made = Maker()
    made.primitive(made.array([(low, 0, 0), (low + 1, 0, 0), (0, -low - 1, 0)], kind, normalized=True))
    np.testing.assert_array_equal(corners(made)[0], [(-1, 0, 0), (-1, 0, 0), (0, 1, 0)])


FINITE = st.floats(-10, 10)


@given(
    st.tuples(FINITE, FINITE, FINITE),
    st.integers(0, 100),
    st.tuples(*[st.sampled_from([-2.0, -0.5, 0.5, 1.0, 3.0])] * 3),
    st.booleans(),
)
def test_nested_transforms_are_applied_and_mirrors_turn_triangles_over(
    offset: tuple[float, float, float], seed: int, scale: tuple[float, float, float], as_matrix: bool
) -> None:
    turn = Rotation.random(rng=seed)
    made = Maker()
    made.primitive(made.array(BOX.vertices), made.array(BOX.faces.ravel(), "u2"))
    if as_matrix:
        matrix = np.eye(4)
        matrix[:3, :3] = turn.as_matrix() * scale
        matrix[:3, 3] = offset
        made.node(matrix=matrix.T.ravel().tolist())  # column after column (section 3.5.3)
    else:
        made.node(translation=offset, rotation=turn.as_quat().tolist(), scale=scale)
    made.json["nodes"].append({"children": [0], "scale": [1, 2, 1], "translation": [0, 0, 5]})
    made.json["scenes"] = [{"nodes": [1]}]
    expected = (turn.apply(BOX.vertices * scale) + offset) * (1, 2, 1) + (0, 0, 5)
    mesh = trimesh.Trimesh(*joined(read(made)), process=False)
    np.testing.assert_allclose(mesh.vertices, expected, atol=1e-5)
    np.testing.assert_allclose(mesh.volume, 6.0 * 2.0 * abs(np.prod(scale)), rtol=1e-5)  # outside is outside


def test_a_mesh_may_be_shown_by_several_nodes_with_their_names() -> None:
    made = Maker().square()
    made.json["nodes"] = [{"mesh": 0, "name": "a"}, {"mesh": 0, "translation": [5, 0, 0]}]
    made.json["meshes"][0]["name"] = "plate"
    made.json["scenes"] = [{"nodes": [0, 1]}]
    one, two = read(made).bodies
    assert (one.name, two.name) == ("a", "plate")
    np.testing.assert_array_equal(two.vertices, one.vertices + np.array([5, 0, 0]))


def test_instances_of_a_node_are_all_there() -> None:
    # EXT_mesh_gpu_instancing
    made = Maker().square()
    attributes = {
        "TRANSLATION": made.array([(0, 0, 0), (0, 0, 4)]),
        "SCALE": made.array([(1, 1, 1), (-2, 2, 2)]),
    }
    made.node(translation=[1, 0, 0], extensions={"EXT_mesh_gpu_instancing": {"attributes": attributes}})
    made.json["extensionsRequired"] = ["EXT_mesh_gpu_instancing"]
    triangles = corners(made)
    np.testing.assert_allclose(triangles[:2], SQUARE + np.array([1, 0, 0]))
    np.testing.assert_allclose(triangles[2:], (SQUARE * [-2, 2, 2] + [1, 0, 4])[:, ::-1])


def test_only_the_default_scene_is_read() -> None:
    made = Maker().square()
    made.json |= {"scene": 1, "scenes": [{"nodes": [0]}, {"nodes": [1]}]}
    made.json["nodes"] = [{"mesh": 0, "name": "spare"}, {"mesh": 0, "translation": [0, 0, 1]}]
    contents = read(made)
    np.testing.assert_array_equal(joined(contents)[0], CORNERS + np.array([0, 0, 1]))
    (note,) = contents.notes
    assert note.code == "left_out_of_gltf"
    assert "1 node with a mesh outside of the default scene (spare)" in note.detail


def test_hidden_nodes_are_left_out_with_a_note() -> None:
    # KHR_node_visibility: it holds for all children
    made = Maker().square()
    hidden = {"KHR_node_visibility": {"visible": False}}
    made.json["nodes"] = [{"mesh": 0}, {"name": "jig", "children": [2], "extensions": hidden}, {"mesh": 0}]
    made.json["scenes"] = [{"nodes": [0, 1]}]
    contents = read(made)
    assert len(contents.bodies) == 1
    assert "1 hidden node with its children (jig)" in contents.notes[0].detail


def test_points_are_a_cloud_of_those_that_are_indexed() -> None:
    made = Maker()
    (cloud,) = read(made.primitive(made.array(CORNERS), made.array([3, 1], "u1"), mode=0)).bodies
    np.testing.assert_array_equal(cloud.vertices, CORNERS[[1, 3]])
    assert len(cloud.faces) == 0


@pytest.mark.parametrize(
    ("primitive", "words"),
    [
        ({"mode": 1, "attributes": {"POSITION": 0}}, "1 primitive of lines (part)"),
        ({"mode": 3, "attributes": {"POSITION": 0}}, "1 primitive of lines (part)"),
        ({"mode": 0, "attributes": {"POSITION": 0}}, "1 primitive of points (part)"),
        ({"attributes": {"NORMAL": 0}}, "1 primitive without positions (part)"),
    ],
)
def test_what_has_no_triangles_is_left_out_with_a_note(primitive: dict[str, Any], words: str) -> None:
    made = Maker().square().node(name="part")
    made.json["meshes"][0]["primitives"].append(primitive)
    contents = read(made)
    np.testing.assert_array_equal(joined(contents)[0], CORNERS)
    (note,) = contents.notes
    assert note.code == "left_out_of_gltf" and words in note.detail


def test_corners_beyond_the_last_triangle_are_noted() -> None:
    contents = read(in_mode(4, [0, 1, 2, 0, 2]))
    assert joined(contents)[1].tolist() == [[0, 1, 2]]
    assert "ends within a triangle" in contents.notes[0].detail


def test_morph_targets_are_not_applied_and_noted() -> None:
    made = Maker().square(targets=[{"POSITION": 0}])
    contents = read(made)
    np.testing.assert_array_equal(joined(contents)[0], CORNERS)
    assert [note.code for note in contents.notes] == ["morph_ignored"]


@pytest.mark.parametrize("joints", [True, False])
def test_a_skinned_mesh_is_where_its_joints_are(joints: bool) -> None:
    """Section 3.7.3.3: the transform of its own node does not count.

    https://github.com/KhronosGroup/glTF-Blender-IO/issues/368
    """
    made = Maker().square().node(skin=0, scale=[100, 100, 100])
    made.json["nodes"] += [{"translation": [0, 0, 3], "scale": [2, 2, 2]}, {"translation": [0, 0, 5]}]
    made.json["scenes"] = [{"nodes": [0, 1, 2]}]
    bind = np.eye(4)
    bind[:3, 3] = (0, 0, -1)
    made.json["skins"] = [{"joints": [1, 2], "inverseBindMatrices": made.array([bind.T.ravel()] * 2)}]
    if joints:
        made.json["meshes"][0]["primitives"][0]["attributes"] |= {
            "JOINTS_0": made.array([(0, 0, 0, 0), (1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 0, 0)], "u1"),
            "WEIGHTS_0": made.array(
                [(255, 0, 0, 0)] * 2 + [(127, 128, 0, 0), (255, 0, 0, 0)], "u1", normalized=True
            ),
        }
    contents = read(made)
    vertices, _ = joined(contents)
    if not joints:
        np.testing.assert_array_equal(vertices, CORNERS * 100)
        assert [note.code for note in contents.notes] == ["skin_ignored"]
        return
    at_first, at_second = CORNERS * 2 + (0, 0, 1), CORNERS + np.array((0, 0, 4))
    mixed = (127 * at_first[2] + 128 * at_second[2]) / 255
    np.testing.assert_allclose(vertices, [at_first[0], at_second[1], mixed, at_first[3]])
    assert contents.notes == ()


def changed(*path: Any, to: Any) -> Maker:
    """A square whose JSON has another value at a place."""
    made = Maker().square()
    place: Any = made.json
    for key in path[:-1]:
        place = place[key]
    place[path[-1]] = to
    return made


def meshopt() -> Maker:
    made = changed("extensionsRequired", to=["EXT_meshopt_compression"])
    extension = {"EXT_meshopt_compression": {"fallback": True}}
    made.json["buffers"].append({"byteLength": 60, "extensions": extension})
    made.json["bufferViews"][0]["buffer"] = 1
    return made


def draco() -> Maker:
    made = Maker().square(extensions={"KHR_draco_mesh_compression": {"bufferView": 0, "attributes": {}}})
    del made.json["accessors"][0]["bufferView"]
    return made


def zeros(count: int) -> Maker:
    made = changed("accessors", 0, "count", to=count)
    del made.json["accessors"][0]["bufferView"]
    return made


WHOLE = Maker().square().glb()
U, T, X, L = errors.UnreadableFile, errors.TruncatedFile, errors.IndexOutOfRange, errors.MeshTooLarge
ONE, TWO = {"mesh": 0, "children": [1]}, {"children": [0]}
REFUSED: dict[str, tuple[Maker | bytes, type[errors.PipelineError], str]] = {
    "cut": (WHOLE[:-9], T, f"announces {len(WHOLE)} bytes and has {len(WHOLE) - 9}"),
    "cut header": (WHOLE[:9], T, "its header alone"),
    "chunk too long": (WHOLE[:12] + struct.pack("<I", 10**6) + WHOLE[16:], T, "chunk at byte 12"),
    "no JSON chunk": (WHOLE[:16] + b"BIN\0" + WHOLE[20:], U, "first chunk"),
    "no chunk": (struct.pack("<4sII", b"glTF", 2, 12), U, "no chunk"),
    "broken JSON": (glb(b'{"asset": {"version": "2.0"}', b""), U, "JSON of the glb"),
    "JSON of another kind": (glb(b"[1, 2]", b""), U, "JSON of the glb"),
    "deep JSON": (glb(b'{"asset":' + b"[" * 100_000, b""), U, "JSON of the glb"),
    "no asset": (glb(b"{}", b""), U, "at asset"),
    "GLB 1": (glb(b"{}", b"", version=1), U, "glTF 1"),
    "glTF 1.0": (changed("asset", "version", to="1.0"), U, r"glTF 1\.0"),
    "glTF 2.1 needed": (changed("asset", "minVersion", to="2.1"), U, r"glTF 2\.1"),
    "wrong type": (changed("nodes", 0, "mesh", to="zero"), U, "at nodes/0/mesh"),
    "negative index": (changed("nodes", 0, "mesh", to=-1), U, "at nodes/0/mesh"),
    "NaN in a matrix": (changed("nodes", 0, "translation", to=[0, 0, float("nan")]), U, "JSON"),
    "mode 7": (changed("meshes", 0, "primitives", 0, "mode", to=7), U, "primitives/0/mode"),
    "other file": (changed("buffers", 0, "uri", to="part.bin"), U, r"another file, 'part\.bin'"),
    "bad base64": (changed("buffers", 0, "uri", to="data:;base64,@@"), U, "base64"),
    "embedded as text": (changed("buffers", 0, "uri", to="data:,abc"), U, "another way"),
    "no data": (changed("bufferViews", 0, "buffer", to=1), U, "buffer 1, but there are 1"),
    "no mesh": (changed("nodes", 0, "mesh", to=5), X, "mesh 5, but there are 1"),
    "no node": (changed("scenes", 0, "nodes", to=[4]), X, "node 4, but there are 1"),
    "no scene": (changed("scene", to=3), X, "scene 3, but there are 1"),
    "no accessor": (changed("meshes", 0, "primitives", 0, "indices", to=8), X, "accessor 8, but there are 2"),
    "no view": (changed("accessors", 0, "bufferView", to=8), X, "buffer view 8, but there are 2"),
    "no child": (changed("nodes", 0, "children", to=[7]), X, "node 7 as a child"),
    "view beyond its buffer": (
        changed("bufferViews", 0, "byteLength", to=900),
        T,
        "buffer view 0 .* byte 900",
    ),
    "accessor beyond its view": (
        changed("accessors", 0, "count", to=5),
        T,
        "accessor 0 .*positions.* byte 60",
    ),
    "offset beyond its view": (changed("accessors", 0, "byteOffset", to=4), T, "byte 52"),
    "stride": (changed("bufferViews", 0, "byteStride", to=4), U, "stride of 4"),
    "component": (changed("accessors", 0, "componentType", to=5124), U, "type 5124"),
    "type": (changed("accessors", 0, "type", to="VEC2"), U, "'VEC2', not VEC3"),
    "float indices": (changed("accessors", 1, "componentType", to=5122), U, "no unsigned integers"),
    "vertex": (changed("accessors", 0, "count", to=3), X, "vertex 3, but there are 3"),
    "zeros without end": (zeros(2**40), L, "1099511627776 vertices"),
    "cyclic nodes": (changed("nodes", to=[ONE, TWO]), U, "node 0 .* its own ancestor"),
    "two parents": (
        changed("nodes", to=[{"children": [2]}, {"children": [2]}, {}]),
        U,
        "node 2 .* child twice",
    ),
    "no rotation": (changed("nodes", 0, "rotation", to=[0, 0, 0, 0]), U, "node 0 .* quaternion"),
    "projection": (changed("nodes", 0, "matrix", to=[1.0] * 16), U, "node 0 .* no affine transform"),
    # https://github.com/zeux/meshoptimizer: gltfpack -c writes a fallback buffer without data
    "meshopt": (meshopt(), U, "EXT_meshopt_compression"),
    "Draco without positions": (draco(), U, "no buffer view with positions"),
    "unknown extension": (changed("extensionsRequired", to=["ACME_warp"]), U, "'ACME_warp'"),
    "lines only": (changed("meshes", 0, "primitives", 0, "mode", to=1), U, "only 1 primitive of lines"),
    "empty scene": (changed("scenes", 0, "nodes", to=[]), U, "only 1 node with a mesh outside"),
    "instances without attributes": (
        changed("nodes", 0, "extensions", to={"EXT_mesh_gpu_instancing": {}}),
        U,
        "no attributes",
    ),
}


@pytest.mark.parametrize("case", REFUSED)
def test_a_bad_file_is_refused_with_its_place(case: str) -> None:
    made, error, words = REFUSED[case]
    with pytest.raises(error, match=words) as caught:
        read(made)
    assert len(caught.value.remedy) > 10


def test_sizes_beyond_the_limits_are_refused() -> None:
    with pytest.raises(errors.MeshTooLarge, match="2 triangles and 4 vertices; the limits are 1"):
        read(Maker().square(), max_faces=1)
    made = Maker().square()
    made.json["nodes"] = [{"mesh": 0}] * 3
    made.json["scenes"] = [{"nodes": [0, 1, 2]}]
    with pytest.raises(errors.MeshTooLarge, match="6 triangles and 12 vertices"):
        read(made, max_faces=5)
