"""An AMF is read with its unit, volumes and constellations, as XML or zipped, or refused with the line.

No library at hand writes AMF: the files are made here, after ISO/ASTM 52915:2020. Dialects are named with
their public source.
"""

import io
import zipfile
from collections.abc import Iterable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.core import errors
from pipeline.core.formats import Format, detect_format
from pipeline.core.mesh_file import MeshFile
from pipeline.core.settings import LoadSettings
from pipeline.stages.load import load
from pipeline.stages.load.amf import read_amf
from pipeline.stages.load.contents import Contents, joined
from pipeline.stages.load.parts import choose_part
from tests.support import shapes

BOX = shapes.box((1.0, 2.0, 3.0))


def volume(faces: Iterable[Iterable[int]] = BOX.faces, attributes: str = "", **metadata: str) -> str:
    told = "".join(
        f'<metadata type="{key.replace("__", ".")}">{value}</metadata>' for key, value in metadata.items()
    )
    rows = "".join(
        "<triangle>" + "".join(f"<v{k}>{v}</v{k}>" for k, v in enumerate(row, 1)) + "</triangle>\n"
        for row in faces
    )
    return f"<volume {attributes}>{told}\n{rows}</volume>\n"


def thing(number: int = 0, *volumes: str, name: str = "") -> str:
    rows = "".join(
        f"<vertex><coordinates><x>{x!r}</x><y>{y!r}</y><z>{z!r}</z></coordinates></vertex>\n"
        for x, y, z in BOX.vertices.tolist()
    )
    told = f'<metadata type="name">{name}</metadata>' if name else ""
    body = "".join(volumes or [volume()])
    return f'<object id="{number}">{told}<mesh>\n<vertices>\n{rows}</vertices>\n{body}</mesh></object>\n'


def amf(*content: str, attributes: str = 'unit="millimeter" version="1.1"') -> bytes:
    return f'<?xml version="1.0" encoding="utf-8"?>\n<amf {attributes}>\n{"".join(content)}</amf>\n'.encode()


def group(number: int, *instances: str) -> str:
    return f'<constellation id="{number}">{"".join(instances)}</constellation>\n'


def instance(target: int, **values: float) -> str:
    told = "".join(f"<{key}>{value}</{key}>" for key, value in values.items())
    return f'<instance objectid="{target}">{told}</instance>\n'


def zipped(data: bytes, name: str = "part.amf") -> bytes:
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr(name, data)
    return out.getvalue()


def read(data: bytes, **limits: int) -> Contents:
    return read_amf(data, LoadSettings(**limits))


PLAIN = amf(thing())


@pytest.mark.parametrize("unit", ["millimeter", "inch", "feet", "meter", "micron", "Inch"])
def test_the_unit_is_that_of_the_file(unit: str) -> None:
    contents = read(amf(thing(), attributes=f'unit="{unit}"'))
    vertices, faces = joined(contents)
    assert contents.unit == unit.lower() and contents.notes == ()
    np.testing.assert_array_equal(vertices, BOX.vertices)
    np.testing.assert_array_equal(faces, BOX.faces)


def test_a_file_without_unit_is_in_millimetres() -> None:
    assert read(amf(thing(), attributes="")).unit == "millimeter"
    assert read(amf(thing(), attributes='unit="league"')).unit == "league"  # refused by `load`


DIALECTS = {
    "CRLF": PLAIN.replace(b"\n", b"\r\n"),
    "one line": PLAIN.replace(b"\n", b""),
    "byte order mark": b"\xef\xbb\xbf" + PLAIN,
    "UTF-16": PLAIN.decode().replace("utf-8", "utf-16").encode("utf-16"),
    "comment": PLAIN.replace(b"<object", b"<!-- made by hand --><object"),
    "no XML declaration": PLAIN.partition(b"\n")[2],
    "namespace": PLAIN.replace(b"<amf ", b'<amf xmlns="http://www.astm.org/amf" '),
    "spaces in numbers": PLAIN.replace(b"<x>", b"<x> ").replace(b"</v1>", b"\n</v1>"),
    "materials and colours": PLAIN.replace(b"<vertices>", b"<color><r>1</r></color><vertices>").replace(
        b"</amf>", b'<material id="1"><color><r>0</r></color></material></amf>'
    ),
    # https://github.com/slic3r/Slic3r/issues/4511 (FreeCAD)
    "zipped": zipped(PLAIN),
    # https://github.com/slic3r/Slic3r/pull/4528: also in a folder
    "zipped in a folder": zipped(PLAIN, "a/b/PART.AMF"),
    # https://github.com/prusa3d/PrusaSlicer/issues/1998 (SolidWorks)
    "constellation without transform": amf(thing(47304), group(0, instance(47304))),
}


@pytest.mark.parametrize("name", DIALECTS)
def test_dialects_give_the_same_box(name: str) -> None:
    data = DIALECTS[name]
    assert detect_format(data[:4096], len(data), "upload") == Format.AMF
    vertices, faces = joined(read(data))
    np.testing.assert_array_equal(vertices, BOX.vertices)
    np.testing.assert_array_equal(faces, BOX.faces)


def test_a_zip_named_otherwise_is_read_by_its_content(tmp_path: Path) -> None:
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w") as archive:
        archive.writestr("readme.txt", "x" * 5000)
        archive.writestr("part.amf", PLAIN)
    (tmp_path / "upload.zip").write_bytes(out.getvalue())
    loaded = load(MeshFile.of(tmp_path / "upload.zip"), "design", LoadSettings(), needs_surface=True)
    assert loaded.format == Format.AMF and len(loaded.mesh.faces) == len(BOX.faces)


def test_both_ways_to_read_rows_give_the_same_also_lines_of_errors() -> None:
    slow = PLAIN.replace(b"<object", b"<!-- no fast path --><object")
    own = PLAIN.replace(b"<mesh>", b'<mesh><vertices cusp-rows="7"/>')
    for data in (PLAIN, slow, own):
        contents = read(data)
        np.testing.assert_array_equal(joined(contents)[0], BOX.vertices)
        with pytest.raises(errors.UnreadableFile, match="line 30: 'x' where"):
            read(
                data.replace(b"</amf>", b"")
                + b"<constellation><instance><rx>x</rx></instance></constellation></amf>"
            )


def test_volumes_are_bodies_with_their_names_and_used_vertices() -> None:
    parts = volume(BOX.faces[:2], name="lid"), volume(BOX.faces[2:])
    contents = read(amf(thing(3, *parts, name="case")))
    assert [body.name for body in contents.bodies] == ["lid", "case"]
    assert len(contents.bodies[0].vertices) < len(BOX.vertices)
    assert sum(len(body.faces) for body in contents.bodies) == len(BOX.faces)
    np.testing.assert_array_equal(
        np.concatenate([body.vertices[body.faces] for body in contents.bodies]), BOX.vertices[BOX.faces]
    )
    assert contents.notes == ()


def test_volumes_of_an_object_are_one_part_and_objects_are_several() -> None:
    halves = volume(BOX.faces[:6]), volume(BOX.faces[6:])
    assert choose_part(read(amf(thing(1, *halves))), None).notes == ()
    two = read(amf(thing(1, *halves, name="peg"), thing(2)))
    assert [note.code for note in choose_part(two, None).notes] == ["several_parts"]
    assert len(choose_part(two, "peg").bodies) == 2
    assert [body.name for body in choose_part(two, "2").bodies] == ["object 2"]


def test_instances_are_turned_about_x_y_z_in_degrees_then_moved() -> None:
    data = amf(thing(1), group(9, instance(1, deltax=10, deltay=20, deltaz=30, rx=90, rz=90)))
    vertices, _ = joined(read(data))
    x, y, z = BOX.vertices.T
    # about x: (x, -z, y); about z: (z, x, y)
    np.testing.assert_allclose(vertices, np.stack([z + 10, x + 20, y + 30], axis=1), atol=1e-12)


def test_slic3r_writes_radians_and_a_scale() -> None:
    told = '<metadata type="cad">Slic3r 1.3.0</metadata>'
    data = amf(told, thing(1), group(9, instance(1, rz=np.pi / 2, scale=2)))
    x, y, z = BOX.vertices.T
    np.testing.assert_allclose(joined(read(data))[0], 2 * np.stack([-y, x, z], axis=1), atol=1e-12)


def test_a_mirrored_instance_keeps_its_outside() -> None:
    vertices, faces = joined(read(amf(thing(1), group(9, instance(1, mirrorx=-1)))))
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    assert np.einsum("ij,ij->", a, np.cross(b, c)) / 6 == pytest.approx(6.0)


def test_several_instances_nested_groups_and_loose_objects_are_listed() -> None:
    data = amf(
        thing(1, name="peg"),
        thing(2),
        group(8, instance(1), instance(1, deltax=5)),
        group(9, instance(8, deltaz=100)),
    )
    contents = read(data)
    lowest = [body.vertices.min(axis=0) - BOX.vertices.min(axis=0) for body in contents.bodies]
    np.testing.assert_allclose(lowest, [[0, 0, 100], [5, 0, 100], [0, 0, 0]], atol=1e-12)
    assert [note.code for note in contents.notes] == ["several_parts"]
    assert "3 parts (1 peg, 2 peg, 3 object 2)" in contents.notes[0].detail


def test_what_is_no_part_is_left_out_and_said() -> None:
    data = amf(
        thing(
            1,
            volume(),
            volume(attributes='type="support"', name="tree"),
            volume(slic3r__modifier="1"),
            volume(slic3r__volume_type="NegativeVolume"),
            volume(slic3r__volume_type="ModelPart"),
        ),
        group(9, instance(1), instance(1, printable=0)),
    )
    contents = read(data)
    assert len(contents.bodies) == 2
    assert {note.code for note in contents.notes} == {"left_out_of_amf"}
    told = " ".join(note.detail for note in contents.notes)
    for what in (
        "1 support (tree)",
        "1 modifier (",
        "1 negative volume (",
        "1 instance marked as not printable",
    ):
        assert what in told
    with pytest.raises(errors.UnreadableFile, match="no triangles that are the part, only 1 support"):
        read(amf(thing(1, volume(attributes='type="support"'))))


def test_curved_triangles_are_read_flat_and_said() -> None:
    curved = PLAIN.replace(b"</vertices>", b"<edge><v1>0</v1><dx1>1</dx1><v2>1</v2></edge></vertices>")
    curved = curved.replace(b"</coordinates>", b"</coordinates><normal><nx>0</nx></normal>", 1)
    contents = read(curved)
    assert len(joined(contents)[1]) == len(BOX.faces)
    assert [note.code for note in contents.notes] == ["curved_triangles"]
    assert "2 edges and vertices" in contents.notes[0].detail


@pytest.mark.parametrize("share", [0.05, 0.4, 0.8, 0.99])
def test_a_cut_file_is_named_with_its_line(share: float) -> None:
    with pytest.raises(errors.TruncatedFile, match=r"ends at line \d+"):
        read(PLAIN[: int(share * len(PLAIN)) - 5])
    with pytest.raises(errors.UnreadableFile, match="not a complete zip archive"):
        read(zipped(PLAIN)[: int(share * len(zipped(PLAIN)))])


@pytest.mark.parametrize(
    ("data", "kind", "reason"),
    [
        (PLAIN.replace(b"<v1>0<", b"<v1>99<", 1), errors.IndexOutOfRange, "vertex 99, but there are 8"),
        (
            PLAIN.replace(b"<v1>0<", b"<v1>" + b"9" * 30 + b"<", 1),
            errors.IndexOutOfRange,
            "refers to vertex 9223",
        ),
        (
            PLAIN.replace(b"<v1>0<", b"<v1>-1<", 1),
            errors.UnreadableFile,
            r"line \d+: a triangle has the corners",
        ),
        (
            PLAIN.replace(b"<v1>", b"<w1>").replace(b"</v1>", b"</w1>"),
            errors.UnreadableFile,
            "not three indices",
        ),
        (PLAIN.replace(b"<x>0.0<", b"<x>0,5<", 1), errors.UnreadableFile, r"line 5: '0,5' where a number"),
        (PLAIN.replace(b"<y>0.0</y>", b"", 1), errors.UnreadableFile, "line 5: a vertex has no coordinates"),
        (PLAIN.replace(b"</volume>", b"</volumes>"), errors.UnreadableFile, "not well-formed"),
        (PLAIN.replace(b"<amf", b"<!DOCTYPE a><amf"), errors.UnreadableFile, "document type"),
        (amf(), errors.UnreadableFile, "the AMF has no triangles"),
        (amf(thing(1), group(9, instance(7))), errors.UnreadableFile, "refers to object '7', which"),
        (amf(thing(1), group(8, instance(9)), group(9, instance(8))), errors.UnreadableFile, "in a circle"),
        (amf(thing(1), group(9, instance(1, scale=0))), errors.UnreadableFile, "is singular"),
        (
            amf(thing(1), group(7, instance(8)), group(8, instance(9)), group(9, instance(8))),
            errors.UnreadableFile,
            "more than 32 others",
        ),
        (zipped(b"", "part.txt"), errors.UnreadableFile, "has no AMF file"),
    ],
)
def test_damage_is_named(data: bytes, kind: type[errors.PipelineError], reason: str) -> None:
    with pytest.raises(kind, match=reason):
        read(data)


def test_nested_groups_do_not_grow_without_limit() -> None:
    groups = [group(k, *[instance(k + 1)] * 10) for k in range(10, 19)]
    with pytest.raises(errors.MeshTooLarge):
        read(amf(thing(19), *groups))


def test_too_many_are_refused_and_a_bomb_too() -> None:
    with pytest.raises(errors.MeshTooLarge):
        read(PLAIN, max_faces=5)
    with pytest.raises(errors.MeshTooLarge, match="more than 5 vertices"):
        read(PLAIN, max_points=5, max_faces=1)
    with pytest.raises(errors.MeshTooLarge, match="unpacks to"):
        read(zipped(PLAIN + b" " * 10**6), max_archive_expansion=20)


BROKEN = [PLAIN, amf(thing(1), group(9, instance(1, rx=3, deltax=2)))]


@given(
    st.sampled_from(BROKEN),
    st.integers(0, 2400),
    st.sampled_from([b"", b"\xff", b"\0", b"nan", b"1e999", b"-1", b"<", b"&a;", b">", b"99999999999"]),
    st.integers(0, 8),
)
def test_a_changed_file_is_read_or_refused(whole: bytes, at: int, evil: bytes, lost: int) -> None:
    try:
        joined(read(whole[:at] + evil + whole[at + lost :]))
    except errors.PipelineError as refused:
        assert refused.reason and refused.remedy
