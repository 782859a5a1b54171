"""A 3MF gives what it prints, once, in place, whoever wrote it; and says what it leaves out or cannot read.

All files are made here. The dialect of each is named with its source.
"""

import io
import itertools
import tempfile
import zipfile
from pathlib import Path

import lib3mf
import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from pipeline.core import errors
from pipeline.core.mesh import FloatArray
from pipeline.core.settings import LoadSettings
from pipeline.stages.load import three_mf_blocks
from pipeline.stages.load.contents import Contents
from pipeline.stages.load.three_mf import read_three_mf
from tests.support import shapes

BOX = shapes.box((1.0, 2.0, 3.0))
CORE = "http://schemas.microsoft.com/3dmanufacturing/core/2015/02"
MODEL_RELATION = "http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel"
ROOT = "3D/3dmodel.model"
NAMESPACES = {
    "p": "http://schemas.microsoft.com/3dmanufacturing/production/2015/06",
    "m": "http://schemas.microsoft.com/3dmanufacturing/material/2015/02",
    "b": "http://schemas.microsoft.com/3dmanufacturing/beamlattice/2017/02",
    "s": "http://schemas.microsoft.com/3dmanufacturing/slice/2015/07",
    "bo": "http://schemas.3mf.io/3dmanufacturing/booleanoperations/2023/07",
    "v": "http://schemas.3mf.io/3dmanufacturing/volumetric/2022/01",
    "sc": "http://schemas.microsoft.com/3dmanufacturing/securecontent/2019/04",
    "slic3r": "http://schemas.slic3r.org/3mf/2017/06",
    "slic3rpe": "http://schemas.slic3r.org/3mf/2017/06",
    "x": "http://vendor.example/lattices",
}


def relations(target: str, kind: str = MODEL_RELATION) -> str:
    return (
        '<Relationships xmlns="http://schemas.openxmlformats.org/package/2006/relationships">'
        f'<Relationship Target="{target}" Id="r0" Type="{kind}"/></Relationships>'
    )


def package(parts: dict[str, str | bytes], target: str | None = f"/{ROOT}") -> bytes:
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as archive:
        if target is not None:
            archive.writestr("_rels/.rels", relations(target))
        for name, content in parts.items():
            archive.writestr(name, content)
    return out.getvalue()


def model(resources: str, build: str, attributes: str = "", unit: str = "millimeter") -> str:
    spaces = " ".join(f'xmlns:{prefix}="{uri}"' for prefix, uri in NAMESPACES.items())
    return (
        f'<?xml version="1.0" encoding="UTF-8"?>\n'
        f'<model unit="{unit}" xmlns="{CORE}" {spaces} {attributes}>\n'
        f"<resources>{resources}</resources>\n<build>{build}</build>\n</model>"
    )


def rows(vertices: FloatArray = BOX.vertices, faces: np.ndarray = BOX.faces, extra: str = "") -> str:
    corners = "".join(f'<vertex x="{x!r}" y="{y!r}" z="{z!r}"/>\n' for x, y, z in vertices.tolist())
    sides = "".join(f'<triangle v1="{a}" v2="{b}" v3="{c}"{extra}/>\n' for a, b, c in faces.tolist())
    return f"<vertices>\n{corners}</vertices>\n<triangles>\n{sides}</triangles>"


def thing(
    number: int, attributes: str = "", at: tuple[float, float, float] = (0, 0, 0), more: str = ""
) -> str:
    """An object that is a box at a place."""
    return f'<object id="{number}" {attributes}><mesh>{rows(BOX.vertices + at)}{more}</mesh></object>'


def joint(number: int, components: str, attributes: str = "") -> str:
    return f'<object id="{number}" {attributes}><components>{components}</components></object>'


def read(parts: dict[str, str | bytes] | str, **limits: int) -> Contents:
    parts = {ROOT: parts} if isinstance(parts, str) else parts
    return read_three_mf(package(parts), LoadSettings(**limits))


def refused(parts: dict[str, str | bytes] | str, kind: type[errors.PipelineError], **limits: int) -> str:
    with pytest.raises(kind) as caught:
        read(parts, **limits)
    assert caught.value.mesh is None and len(caught.value.remedy) > 10
    return caught.value.reason


def text(transform: FloatArray) -> str:
    return " ".join(repr(float(x)) for x in transform.ravel())


def notes(contents: Contents, code: str = "left_out_of_3mf") -> list[str]:
    return [note.detail for note in contents.notes if note.code == code]


def places(contents: Contents) -> list[list[float]]:
    return [body.vertices.min(axis=0).tolist() for body in contents.bodies]


# --- the core specification


def test_an_object_is_read_with_its_name_and_unit() -> None:
    contents = read(model(thing(7, 'name="bracket"'), '<item objectid="7"/>', unit="inch"))
    (body,) = contents.bodies
    np.testing.assert_array_equal(body.vertices, BOX.vertices)
    np.testing.assert_array_equal(body.faces, BOX.faces)
    assert (body.name, contents.unit, contents.notes) == ("bracket", "inch", ())


def test_the_default_unit_is_the_millimetre_and_the_default_name_the_id() -> None:
    xml = model(thing(7), '<item objectid="7"/>').replace('unit="millimeter"', "")
    contents = read(xml)
    assert (contents.unit, contents.bodies[0].name) == ("millimeter", "object 7")


def test_a_transform_is_applied_to_row_vectors() -> None:
    # core specification 3.3: the first three numbers are where the x axis goes, the last three the origin
    item = '<item objectid="1" transform="0 1 0 -1 0 0 0 0 1 10 20 30"/>'
    (body,) = read(model(thing(1), item)).bodies
    x, y, z = BOX.vertices.T
    np.testing.assert_allclose(body.vertices, np.column_stack([10 - y, 20 + x, 30 + z]))


@pytest.mark.parametrize(
    ("item", "inner", "is_mirrored"),
    [("-1 0 0 0 1 0 0 0 1 0 0 0", "", True), ("-1 0 0 0 1 0 0 0 1 0 0 0", "1 0 0 0 1 0 0 0 -1 0 0 0", False)],
)
def test_a_mirrored_object_keeps_its_outside(item: str, inner: str, is_mirrored: bool) -> None:
    component = f'<component objectid="1" transform="{inner}"/>' if inner else '<component objectid="1"/>'
    build = f'<item objectid="2" transform="{item}"/>'
    (body,) = read(model(thing(1) + joint(2, component), build)).bodies
    a, b, c = (body.vertices[body.faces[:, k]] for k in range(3))
    assert np.einsum("fd,fd->", a, np.cross(b, c)) / 6 == pytest.approx(6.0)
    assert (body.faces.tolist() == BOX.faces.tolist()) is not is_mirrored


@st.composite
def motions(draw: st.DrawFn) -> FloatArray:
    """(4, 3): a rotation, scaled or mirrored, and a shift."""
    turn = Rotation.random(rng=draw(st.integers(0, 99))).as_matrix()
    scale = np.diag([draw(st.sampled_from([-2.0, -1.0, 0.5, 1.0, 3.0])) for _ in range(3)])
    shift = [draw(st.floats(-50, 50)) for _ in range(3)]
    return np.vstack([turn @ scale, shift])


@settings(deadline=None, max_examples=40)
@given(st.lists(motions(), min_size=1, max_size=5))
def test_nested_transforms_follow_one_another_from_the_inside(chain: list[FloatArray]) -> None:
    resources = thing(1)
    for number, transform in enumerate(chain[:-1], start=2):
        resources += joint(number, f'<component objectid="{number - 1}" transform="{text(transform)}"/>')
    item = f'<item objectid="{len(chain)}" transform="{text(chain[-1])}"/>'
    (body,) = read(model(resources, item)).bodies
    expected, sign = BOX.vertices, 1.0
    for transform in chain:
        expected = np.column_stack([expected, np.ones(len(expected))]) @ transform
        sign *= np.sign(np.linalg.det(transform[:3]))
    np.testing.assert_allclose(body.vertices, expected, atol=1e-9 * (1 + np.abs(expected).max()))
    np.testing.assert_array_equal(body.faces, BOX.faces if sign > 0 else BOX.faces[:, ::-1])


def test_an_object_used_several_times_is_there_several_times_in_order() -> None:
    components = "".join(
        f'<component objectid="1" transform="1 0 0 0 1 0 0 0 1 {x} 0 0"/>' for x in (30, 10, 20)
    )
    contents = read(model(thing(1) + joint(2, components), '<item objectid="2"/>'))
    assert [place[0] for place in places(contents)] == [30, 10, 20]


def test_only_what_is_built_is_read_and_the_rest_is_named() -> None:
    contents = read(model(thing(1) + thing(2, 'name="spare"'), '<item objectid="1"/>'))
    assert len(contents.bodies) == 1
    assert notes(contents) == [
        "the 3MF: 1 object that no build item uses (spare; 12 triangles) is not part of the print "
        "and was left out"
    ]


def test_several_items_are_read_as_one_part_and_counted() -> None:
    build = '<item objectid="1"/><item objectid="2" transform="1 0 0 0 1 0 0 0 1 50 0 0"/>'
    contents = read(model(thing(1, 'name="left"') + thing(2, 'name="right"'), build))
    assert len(contents.bodies) == 2
    (detail,) = notes(contents, "several_parts")
    assert "2 parts are on the plate (1 left, 2 right)" in detail


@pytest.mark.parametrize("kind", ["support", "solidsupport", "other", "surface"])
def test_objects_of_other_types_are_left_out(kind: str) -> None:
    # core specification 4: only objects of type model are the part
    resources = thing(1) + thing(2, f'type="{kind}" name="a"') + thing(3, f'type="{kind}" name="b"')
    contents = read(model(resources, '<item objectid="1"/><item objectid="2"/><item objectid="3"/>'))
    assert len(contents.bodies) == 1 and notes(contents, "several_parts") == []
    assert notes(contents) == [
        f"the 3MF: 2 objects of type {kind} (a, b; 24 triangles) are not part of the print and were left out"
    ]


def test_a_file_of_supports_only_is_refused() -> None:
    reason = refused(
        model(thing(1, 'type="support" name="tree"'), '<item objectid="1"/>'), errors.UnreadableFile
    )
    assert reason == "the 3MF prints no part, only 1 object of type support (tree; 12 triangles)"


def test_a_file_of_surfaces_only_is_read() -> None:
    # FreeCAD 0.21 (PrusaSlicer issue 11999), and aligned.3mf of our own report
    assert len(read(model(thing(1, 'type="surface"'), '<item objectid="1"/>')).bodies) == 1


# --- the package (OPC)


@pytest.mark.parametrize(
    ("name", "target"),
    [
        ("3D/3dmodel.model", "/3D/3dmodel.model"),
        ("3D/3dmodel.model", "3D/3dmodel.model"),
        ("3d/3DModel.MODEL", "/3D/3dmodel.model"),
        ("/3D/3dmodel.model", "/3D/3dmodel.model"),
        ("3D\\3dmodel.model", "/3D/3dmodel.model"),
        ("Geometry/part one.xml", "/Geometry/part%20one.xml"),
        ("3D/3dmodel.model", None),
        ("3D/box.model", None),
        ("3D/box.model", "/3D/3dmodel.model"),
    ],
)
def test_the_root_model_is_found(name: str, target: str | None) -> None:
    data = package({name: model(thing(1), '<item objectid="1"/>')}, target)
    assert len(read_three_mf(data, LoadSettings()).bodies) == 1


def test_a_zip_without_model_is_no_3mf() -> None:
    with pytest.raises(errors.UnreadableFile, match="is not a 3MF: it has no model part"):
        read_three_mf(package({"word/document.xml": "<w/>"}, None), LoadSettings())


@pytest.mark.parametrize("has_model", [True, False])
def test_gcode_without_mesh_is_named(has_model: bool) -> None:
    # Bambu Studio, "export plate sliced file": .gcode.3mf with an empty model
    parts: dict[str, str | bytes] = {"Metadata/plate_1.gcode": "G1 X0"}
    if has_model:
        parts[ROOT] = model("", "")
    assert "G-code of a sliced plate (Metadata/plate_1.gcode)" in refused(parts, errors.UnreadableFile)


def test_encrypted_content_is_named() -> None:
    # Secure Content extension: an encrypted part starts with its own header
    parts: dict[str, str | bytes] = {
        ROOT: model(joint(1, '<component p:path="/3D/a.model" objectid="1"/>'), '<item objectid="1"/>'),
        "3D/a.model": b"%3McF" + bytes(20),
    }
    assert "3D/a.model in the 3MF is encrypted" in refused(parts, errors.UnreadableFile)


def test_a_password_is_named() -> None:
    data = bytearray(package({ROOT: model(thing(1), '<item objectid="1"/>')}))
    for signature, flags in ((b"PK\x03\x04", 6), (b"PK\x01\x02", 8)):
        place = data.rindex(signature)
        data[place + flags] |= 1
    with pytest.raises(errors.UnreadableFile, match="protected with a password"):
        read_three_mf(bytes(data), LoadSettings())


def test_a_damaged_zip_entry_is_named() -> None:
    data = bytearray(package({ROOT: model(thing(1), '<item objectid="1"/>')}))
    place = data.index(ROOT.encode()) + len(ROOT) + 50
    data[place : place + 8] = bytes(8)
    with pytest.raises(errors.UnreadableFile, match=f"{ROOT} in the 3MF is damaged"):
        read_three_mf(bytes(data), LoadSettings())


def test_an_entry_without_name_does_no_harm() -> None:
    # the name of a zip entry can be lost to damage
    data = package({"x": "", ROOT: model(thing(1), '<item objectid="1"/>')}, None)
    central = data.index(b"PK\x01\x02")
    shortened = data[: central + 28] + bytes(2) + data[central + 30 : central + 46] + data[central + 47 :]
    end = shortened.rindex(b"PK\x05\x06")
    size = int.from_bytes(shortened[end + 12 : end + 16], "little") - 1
    whole = shortened[: end + 12] + size.to_bytes(4, "little") + shortened[end + 16 :]
    assert len(read_three_mf(whole, LoadSettings()).bodies) == 1


# --- production extension


def in_parts(unit: str = "millimeter") -> dict[str, str | bytes]:
    """Two parts that use the same ids, as Bambu Studio writes projects: 3D/Objects/object_1.model, ..."""
    spread = "1 0 0 0 1 0 0 0 1 10 0 0"
    return {
        ROOT: model(
            joint(3, '<component p:path="/3D/Objects/a.model" objectid="2"/>')
            + joint(4, f'<component p:path="/3D/objects/B.model" objectid="1" transform="{spread}"/>'),
            '<item objectid="3"/><item objectid="4" transform="1 0 0 0 1 0 0 0 1 100 0 0"/>',
            'requiredextensions="p"',
        ),
        "3D/Objects/a.model": model(thing(1, at=(0, 5, 0)) + thing(2, at=(0, 6, 0)), ""),
        "3D/Objects/b.model": model(thing(1, at=(0, 7, 0)), "", unit=unit),
    }


def test_each_component_is_read_once_from_its_part() -> None:
    assert places(read(in_parts())) == [[0, 6, 0], [110, 7, 0]]


def test_a_part_with_another_unit_is_scaled_to_that_of_the_root() -> None:
    contents = read(in_parts(unit="centimeter"))
    assert places(contents)[1] == [110, 70, 0] and contents.unit == "millimeter"


def test_a_build_item_may_refer_to_another_part() -> None:
    parts = in_parts()
    parts[ROOT] = model("", '<item objectid="1" p:path="/3D/Objects/b.model"/>')
    assert places(read(parts)) == [[0, 7, 0]]


def test_a_component_of_a_sub_part_is_of_the_same_part_and_in_its_unit() -> None:
    shifted = joint(9, '<component objectid="1" transform="1 0 0 0 1 0 0 0 1 2 0 0"/>')
    parts = in_parts()
    parts[ROOT] = model(
        joint(1, '<component p:path="/3D/Objects/b.model" objectid="9"/>'), '<item objectid="1"/>'
    )
    parts["3D/Objects/b.model"] = model(thing(1) + shifted, "", unit="inch")
    (body,) = read(parts).bodies
    np.testing.assert_allclose(body.vertices, 25.4 * (BOX.vertices + np.array([2, 0, 0])))


def test_an_unknown_unit_of_a_part_is_named() -> None:
    assert "3D/Objects/b.model in the 3MF declares the unit 'cubit'" in refused(
        in_parts("cubit"), errors.UnitUnknown
    )


# --- slicers


def slicer(volumes: str, name: str = "Metadata/Slic3r_PE_model.config") -> dict[str, str | bytes]:
    """PrusaSlicer: one mesh of three boxes; the config has the triangles of each volume."""
    three = np.concatenate([BOX.vertices + np.array([10 * k, 0, 0]) for k in range(3)])
    faces = np.concatenate([BOX.faces + len(BOX.vertices) * k for k in range(3)])
    return {
        ROOT: model(
            f'<object id="1" type="model"><mesh>{rows(three, faces)}</mesh></object>', '<item objectid="1"/>'
        ),
        name: f'<?xml version="1.0"?>\n<config>\n<object id="1">{volumes}</object></config>',
    }


def volume(first: int, last: int, key: str, value: str, name: str = "") -> str:
    return (
        f'<volume firstid="{first}" lastid="{last}"><metadata type="volume" key="name" value="{name}"/>'
        f'<metadata type="volume" key="{key}" value="{value}"/></volume>'
    )


@pytest.mark.parametrize(
    ("key", "value", "role"),
    [
        ("volume_type", "ParameterModifier", "modifier"),
        ("volume_type", "NegativeVolume", "negative volume"),
        ("volume_type", "SupportBlocker", "support blocker"),
        ("volume_type", "SupportEnforcer", "support enforcer"),
        ("modifier", "1", "modifier"),
    ],
)
def test_volumes_of_prusaslicer_that_are_no_part_are_left_out(key: str, value: str, role: str) -> None:
    volumes = volume(0, 11, "volume_type", "ModelPart") + volume(12, 23, key, value, "helper")
    contents = read(slicer(volumes + volume(24, 35, "volume_type", "ModelPart")))
    (body,) = contents.bodies
    assert (len(body.vertices), len(body.faces)) == (16, 24)
    assert sorted({float(x) for x in body.vertices[:, 0]}) == [0, 1, 20, 21]
    (detail,) = notes(contents)
    assert detail.startswith(f"the 3MF: 1 {role} (helper; 12 triangles) is not ")


def test_an_inline_volume_of_slic3r_is_left_out() -> None:
    # Slic3r 1.3: <slic3r:volumes> within the mesh, ts to te inclusive
    parts = slicer("", "Metadata/none.txt")
    volumes = (
        '<slic3r:volumes><slic3r:volume ts="0" te="11" modifier="0"/>'
        '<slic3r:volume ts="12" te="35" modifier="1"/></slic3r:volumes></mesh>'
    )
    contents = read({ROOT: str(parts[ROOT]).replace("</mesh>", volumes)})
    assert len(contents.bodies[0].faces) == 12 and "1 modifier" in notes(contents)[0]


def test_ranges_beyond_the_mesh_do_no_harm() -> None:
    volumes = volume(30, 99, "volume_type", "ParameterModifier") + volume(-9, -5, "modifier", "1")
    assert len(read(slicer(volumes)).bodies[0].faces) == 30


@pytest.mark.parametrize(
    ("subtype", "role"),
    [
        ("modifier_part", "modifier"),
        ("negative_part", "negative volume"),
        ("support_blocker", "support blocker"),
        ("support_enforcer", "support enforcer"),
    ],
)
def test_parts_of_bambu_studio_that_are_no_part_are_left_out(subtype: str, role: str) -> None:
    # Bambu Studio and OrcaSlicer: Metadata/model_settings.config, by object id and component's object id
    parts = in_parts()
    component = '<component p:path="/3D/Objects/a.model" objectid="{}"/>'
    parts[ROOT] = model(
        joint(5, component.format(1) + component.format(2)), '<item objectid="5" printable="1"/>'
    )
    parts["Metadata/model_settings.config"] = (
        '<?xml version="1.0"?><config><object id="5"><metadata key="name" value="Clip"/>'
        '<part id="1" subtype="normal_part"><metadata key="name" value="body"/></part>'
        f'<part id="2" subtype="{subtype}"><metadata key="name" value="helper"/></part></object></config>'
    )
    contents = read(parts)
    assert [(body.name, len(body.faces)) for body in contents.bodies] == [("body", 12)]
    assert places(contents) == [[0, 5, 0]]
    assert notes(contents)[0].startswith(f"the 3MF: 1 {role} (helper; 12 triangles) is not ")


def test_parts_with_the_same_id_in_two_parts_are_told_apart_by_their_order() -> None:
    parts = in_parts()
    component = '<component p:path="/3D/Objects/{}.model" objectid="1"/>'
    parts[ROOT] = model(joint(5, component.format("a") + component.format("b")), '<item objectid="5"/>')
    parts["Metadata/model_settings.config"] = (
        '<config><object id="5"><part id="1" subtype="modifier_part"/><part id="1" subtype="normal_part"/>'
        "</object></config>"
    )
    assert places(read(parts)) == [[0, 7, 0]]


def test_a_support_blocker_of_cura_is_left_out() -> None:
    # Cura project: settings of a mesh in the metadata of its object
    setting = '<metadatagroup><metadata name="cura:anti_overhang_mesh">True</metadata></metadatagroup>'
    blocker = thing(2, 'name="blocker"').replace("<mesh>", setting + "<mesh>")
    off = thing(1).replace("<mesh>", setting.replace("True", "False") + "<mesh>")
    contents = read(model(off + blocker, '<item objectid="1"/><item objectid="2"/>'))
    assert len(contents.bodies) == 1
    assert notes(contents)[0].startswith("the 3MF: 1 support blocker (blocker; 12 triangles)")


def test_items_that_are_not_printable_are_left_out() -> None:
    # PrusaSlicer, Bambu Studio: printable="0" of an item
    build = '<item objectid="1"/><item objectid="2" printable="0"/>'
    contents = read(model(thing(1) + thing(2, 'name="spare"'), build))
    assert len(contents.bodies) == 1
    assert notes(contents)[0].startswith(
        "the 3MF: 1 build item marked as not printable (spare; 12 triangles) is"
    )


def test_a_plate_of_items_that_are_not_printable_is_refused() -> None:
    reason = refused(model(thing(1), '<item objectid="1" printable="0"/>'), errors.UnreadableFile)
    assert "only 1 build item marked as not printable" in reason


def test_modifiers_only_are_refused() -> None:
    reason = refused(slicer(volume(0, 35, "modifier", "1", "m")), errors.UnreadableFile)
    assert reason == "the 3MF prints no part, only 1 modifier (m; 36 triangles)"


def test_damaged_settings_of_a_slicer_are_an_error() -> None:
    parts = slicer("<volume")
    assert "Metadata/Slic3r_PE_model.config in the 3MF, line 3: the XML is" in refused(
        parts, errors.UnreadableFile
    )


# --- other geometry and extensions


def test_colours_and_painted_supports_do_not_change_the_mesh() -> None:
    # materials extension: p1; PrusaSlicer, Bambu Studio: painted triangles
    painted = rows(extra=' pid="1" p1="0" slic3rpe:custom_supports="8"').replace(' pid="1" p1="0"', "", 3)
    colours = '<m:colorgroup id="1"><m:color color="#FF0000FF"/></m:colorgroup>'
    xml = model(
        f'{colours}<object id="2" pid="1" pindex="0"><mesh>{painted}</mesh></object>', '<item objectid="2"/>'
    )
    (body,) = read(xml).bodies
    np.testing.assert_array_equal(body.faces, BOX.faces)


def test_a_beam_lattice_is_reported_as_not_read() -> None:
    lattice = '<b:beamlattice radius="1"><b:beams><b:beam v1="0" v2="1"/></b:beams></b:beamlattice>'
    contents = read(model(thing(1, 'name="core"', more=lattice), '<item objectid="1"/>'))
    assert len(contents.bodies) == 1
    assert notes(contents) == [
        "the 3MF: 1 object with beam lattice (core) is read without it: only triangles are read"
    ]


def test_slices_beside_triangles_are_ignored_and_alone_are_refused() -> None:
    stack = '<s:slicestack id="9"/>'
    both = model(stack + thing(1, 's:slicestackid="9"'), '<item objectid="1"/>')
    assert read(both).notes == ()
    empty = '<object id="1" s:slicestackid="9"><mesh><vertices></vertices><triangles/></mesh></object>'
    alone = model(stack + empty + joint(2, '<component objectid="1"/>'), '<item objectid="2"/>')
    assert "only 1 object with slices (object 1)" in refused(alone, errors.UnreadableFile)


@pytest.mark.parametrize(
    ("prefix", "name"),
    [
        ("b", "beam lattice"),
        ("s", "slices"),
        ("bo", "boolean operations"),
        ("v", "volumetric design"),
        ("sc", "Secure Content"),
        ("x", "http://vendor.example/lattices"),
        ("nowhere", "with prefix 'nowhere'"),
    ],
)
def test_a_required_extension_that_is_not_read_is_refused_by_name(prefix: str, name: str) -> None:
    xml = model(thing(1), '<item objectid="1"/>', f'requiredextensions="p m {prefix}"')
    assert f"requires the extension {name}" in refused(xml, errors.UnreadableFile)


# --- errors

GOOD = model(thing(1), '<item objectid="1"/>')
BAD: dict[str, tuple[str, type[errors.PipelineError], str]] = {
    "empty build": (
        model(thing(1), ""),
        errors.UnreadableFile,
        "<build> section of 3D/3dmodel.model in the 3MF is",
    ),
    "missing object": (
        GOOD.replace('objectid="1"', 'objectid="5"'),
        errors.UnreadableFile,
        "line 27: 3D/3dmodel",
    ),
    "missing part": (
        model(joint(1, '\n<component p:path="/3D/a.model" objectid="1"/>'), '<item objectid="1"/>'),
        errors.UnreadableFile,
        "line 4: the 3MF has no part /3D/a.model",
    ),
    "cycle": (
        model(
            joint(1, '<component objectid="2"/>') + joint(2, '<component objectid="1"/>'),
            '<item objectid="1"/>',
        ),
        errors.UnreadableFile,
        "component of itself (1 > 2 > 1)",
    ),
    "deep": (
        model(
            thing(1) + "".join(joint(k, f'<component objectid="{k - 1}"/>') for k in range(2, 200)),
            '<item objectid="199"/>',
        ),
        errors.UnreadableFile,
        "more than 64 levels",
    ),
    "index": (
        GOOD.replace('v3="', 'v3="9', 1),
        errors.IndexOutOfRange,
        "line 14: triangle 0 of object 1 refers to vertex 9",
    ),
    "negative index": (GOOD.replace('v3="', 'v3="-', 1), errors.IndexOutOfRange, "refers to vertex -"),
    "huge index": (GOOD.replace('v3="', 'v3="99999999999999999999', 1), errors.IndexOutOfRange, "triangle 0"),
    "index that is no number": (
        GOOD.replace('v3="', 'v3="a', 1),
        errors.UnreadableFile,
        "triangle 0 of object 1 has",
    ),
    "index with a fraction": (
        GOOD.replace('v3="', 'v3="1.5', 1),
        errors.UnreadableFile,
        "triangle 0 of object 1 has",
    ),
    "decimal comma": (
        GOOD.replace('"1.0" y', '"1,0" y', 1),
        errors.UnreadableFile,
        "line 5: vertex 1 of object 1 has a bad",
    ),
    "no z": (GOOD.replace(' z="0.0"', "", 1), errors.UnreadableFile, "line 4: vertex 0 of object 1 has no z"),
    "two objects with one id": (
        model(thing(1) + thing(1), '<item objectid="1"/>'),
        errors.UnreadableFile,
        "a second",
    ),
    "no id": (
        model(thing(1).replace('id="1"', ""), '<item objectid="1"/>'),
        errors.UnreadableFile,
        "has no id",
    ),
    "no objectid": (model(thing(1), "<item/>"), errors.UnreadableFile, "the item has no objectid"),
    "transform": (
        model(thing(1), '<item objectid="1" transform="1 0 0 0 1 0"/>'),
        errors.UnreadableFile,
        "is not 12 numbers",
    ),
    "flat transform": (
        model(thing(1), '<item objectid="1" transform="1 0 0 0 1 0 0 0 0 0 0 0"/>'),
        errors.UnreadableFile,
        "has no inverse",
    ),
    "cut": (GOOD[: len(GOOD) // 2], errors.TruncatedFile, f"{ROOT} in the 3MF ends at line"),
    "cut between rows": (
        GOOD[: GOOD.index("</triangles>")],
        errors.TruncatedFile,
        f"{ROOT} in the 3MF ends at",
    ),
    "empty part": ("", errors.TruncatedFile, f"{ROOT} in the 3MF is empty"),
    "not XML": (
        GOOD.replace("</build>", "<</build>"),
        errors.UnreadableFile,
        "line 27: the XML is not well-formed",
    ),
    "no model": ("<html></html>", errors.UnreadableFile, "its root element is <html>"),
    "entities": ('<!DOCTYPE model [<!ENTITY a "b">]>' + GOOD[39:], errors.UnreadableFile, "has a DTD"),
    "no triangles": (
        model('<object id="1"><mesh/></object>', '<item objectid="1"/>'),
        errors.UnreadableFile,
        "prints no triangles",
    ),
}


@pytest.mark.parametrize("case", BAD)
def test_a_bad_file_is_refused_with_place_and_remedy(case: str) -> None:
    xml, kind, words = BAD[case]
    assert words in refused(xml, kind)


def test_components_cannot_multiply_without_limit() -> None:
    twice = "".join(joint(k, f'<component objectid="{k - 1}"/>' * 2) for k in range(2, 40))
    xml = model(thing(1) + twice, '<item objectid="39"/>')
    assert f"builds {12 * 2**38} triangles" in refused(xml, errors.MeshTooLarge)
    assert "2048 triangles; the limit is 2000" in refused(
        model(
            '<object id="1"><mesh>' + rows(faces=BOX.faces[:1]) + "</mesh></object>" + twice,
            '<item objectid="12"/>',
        ),
        errors.MeshTooLarge,
        max_faces=2000,
    )
    empty = model('<object id="1"><mesh/></object>' + twice, '<item objectid="39"/>')
    assert "no triangles" in refused(empty, errors.UnreadableFile)


def test_many_small_meshes_are_bounded_too() -> None:
    single = '<object id="1"><mesh>' + rows(faces=BOX.faces[:1]) + "</mesh></object>"
    twice = "".join(joint(k, f'<component objectid="{k - 1}"/>' * 2) for k in range(2, 20))
    assert "262144 meshes; the limit" in refused(
        model(single + twice, '<item objectid="19"/>'), errors.MeshTooLarge
    )


# --- the fast path, and other writers

FORMS = {
    "usual": lambda xml: xml,
    "comment": lambda xml: xml.replace("<resources>", "<!-- <vertices> --><resources>"),
    "other order": lambda xml: xml.replace("<vertex x", "<vertex  x", 1),
    "closing tags": lambda xml: xml.replace('"/>\n', '"></vertex>\n', 8),
    "one line": lambda xml: xml.replace("\n", ""),
    "indented": lambda xml: xml.replace("\n<", "\r\n    <"),
    "prefix": lambda xml: prefixed(xml),
    "UTF-16": lambda xml: xml.replace("UTF-8", "UTF-16").encode("utf-16"),
    "byte order mark": lambda xml: xml.encode("utf-8-sig"),
    "exponents": lambda xml: xml.replace('x="1.0', 'x="+1.0e+0').replace("2.0", "20E-1"),
    "single quotes": lambda xml: xml.replace('"', "'"),
}


def prefixed(xml: str) -> str:
    """xml.etree writes every element with a prefix."""
    xml = xml.replace(f'xmlns="{CORE}"', f'xmlns:ns0="{CORE}"')
    for opening in ("</", "<"):
        pieces = xml.split(opening)
        xml = pieces[0] + "".join(
            opening + (piece if piece[0] in "/?n" else f"ns0:{piece}") for piece in pieces[1:]
        )
    return xml


@pytest.mark.parametrize("form", FORMS)
def test_the_form_of_the_xml_does_not_matter(form: str) -> None:
    (body,) = read({ROOT: FORMS[form](GOOD)}).bodies
    np.testing.assert_array_equal(body.vertices, BOX.vertices)
    np.testing.assert_array_equal(body.faces, BOX.faces)


def test_swapped_attributes_of_one_row_are_not_mixed_up() -> None:
    xml = GOOD.replace('<vertex x="0.0" y="0.0" z="3.0"/>', '<vertex x="0.0" z="3.0" y="0.0"/>')
    assert xml != GOOD
    np.testing.assert_array_equal(read(xml).bodies[0].vertices, BOX.vertices)


@pytest.mark.parametrize("chunk", [100, 1000, 10_000])
def test_tables_are_the_same_in_chunks_and_by_the_xml_parser(
    chunk: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    sphere = shapes.icosphere(3.0, 2)
    xml = model(
        f'<object id="1"><mesh>{rows(sphere.vertices, sphere.faces)}</mesh></object>', '<item objectid="1"/>'
    )
    monkeypatch.setattr(three_mf_blocks, "CHUNK", chunk)
    assert three_mf_blocks.cut(xml.encode()) is not None
    for each in (xml, xml.replace("<build>", "<!-- --><build>")):
        (body,) = read(each).bodies
        np.testing.assert_array_equal(body.vertices, sphere.vertices)
        np.testing.assert_array_equal(body.faces, sphere.faces)


def corners(vertices: FloatArray, faces: np.ndarray) -> FloatArray:
    return np.asarray(vertices[faces])


def test_a_file_of_trimesh_is_read_back() -> None:
    scene = trimesh.Scene()
    moves = [trimesh.transformations.translation_matrix([5, 0, 0]), np.diag([1.0, 1.0, -1.0, 1.0])]
    mesh = trimesh.Trimesh(BOX.vertices, BOX.faces, process=False)
    for move in moves:
        scene.add_geometry(mesh, transform=move)
    contents = read_three_mf(trimesh.exchange.threemf.export_3MF(scene), LoadSettings())
    assert len(contents.bodies) == 2
    found = sorted(corners(body.vertices, body.faces).sum() for body in contents.bodies)
    expected = [corners(trimesh.transform_points(BOX.vertices, move), BOX.faces).sum() for move in moves]
    np.testing.assert_allclose(found, sorted(expected))


def test_a_file_of_lib3mf_is_read_back() -> None:
    library = lib3mf.get_wrapper()
    made = library.CreateModel()
    made.SetUnit(lib3mf.ModelUnit.CentiMeter)
    mesh = made.AddMeshObject()
    mesh.SetName("lib3mf box")
    for point in BOX.vertices.tolist():
        position = lib3mf.Position()
        position.Coordinates[:] = point
        mesh.AddVertex(position)
    for face in BOX.faces.tolist():
        triangle = lib3mf.Triangle()
        triangle.Indices[:] = face
        mesh.AddTriangle(triangle)
    group = made.AddComponentsObject()
    moves = [motion(seed) for seed in range(3)]
    for move in moves[:2]:
        group.AddComponent(mesh, lib3mf_transform(move))
    made.AddBuildItem(group, lib3mf_transform(moves[2]))
    support = made.AddMeshObject()
    support.SetGeometry(*geometry_of(mesh))
    support.SetType(lib3mf.ObjectType.Support)
    made.AddBuildItem(support, library.GetIdentityTransform())
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "made.3mf"
        made.QueryWriter("3mf").WriteToFile(str(path))
        contents = read_three_mf(path.read_bytes(), LoadSettings())
    assert contents.unit == "centimeter" and [body.name for body in contents.bodies] == ["lib3mf box"] * 2
    for body, move in zip(contents.bodies, moves[:2], strict=True):
        expected = BOX.vertices
        for each in (move, moves[2]):
            expected = np.column_stack([expected, np.ones(len(expected))]) @ each
        np.testing.assert_allclose(body.vertices, expected, atol=1e-4)  # single precision
        np.testing.assert_array_equal(body.faces, BOX.faces)
    assert "1 object of type support" in notes(contents)[0]


def motion(seed: int) -> FloatArray:
    return np.vstack([Rotation.random(rng=seed).as_matrix(), [10.0 * seed, 1.0, -2.0]])


def lib3mf_transform(move: FloatArray) -> lib3mf.Transform:
    transform = lib3mf.Transform()
    for row, column in itertools.product(range(4), range(3)):
        transform.Fields[row][column] = float(move[row, column])
    return transform


def geometry_of(mesh: lib3mf.MeshObject) -> tuple[object, object]:
    return mesh.GetVertices(), mesh.GetTriangleIndices()
