"""A STEP is read in its own unit, closed and exact to 0.01 % of its size, or refused with what is wrong.

All files are made by formula (`tests.support.step_files`). Open CASCADE, which reads them, is an independent
implementation of the standard.
"""

import math
import re
from importlib import util
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from pipeline.core import errors
from pipeline.core.formats import Format, detect_format
from pipeline.core.mesh import Mesh
from pipeline.core.settings import LoadSettings
from pipeline.stages.load import extras, step_process
from pipeline.stages.load.contents import Contents, joined
from pipeline.stages.load.parts import choose_part
from pipeline.stages.load.step import TESSELLATION_SHARE, read_step
from pipeline.stages.load.step_process import Tessellation
from pipeline.stages.load.step_text import read_step_text
from pipeline.stages.load.units import DECLARED
from tests.support.step_files import CONVERTED, SCHEMAS, UNITS, Step, box, cylinder

BOX = box((10.0, 20.0, 30.0))
SIZE = np.array([1.0, 2.0, 3.0])


def read(data: bytes, **limits: int) -> Contents:
    return read_step(data, LoadSettings(**limits))


def volume(contents: Contents) -> float:
    vertices, faces = joined(contents)
    return float(
        np.einsum("ij,ij->i", vertices[faces[:, 0]], Mesh(vertices, faces).face_cross_mm2()).sum() / 6
    )


def codes(contents: Contents) -> list[str]:
    return [note.code for note in contents.notes]


@pytest.mark.parametrize("unit", [*UNITS, *CONVERTED])
def test_the_numbers_are_in_the_unit_of_the_file(unit: str) -> None:
    contents = read(box((10.0, 20.0, 30.0), unit=unit))
    vertices, _ = joined(contents)
    np.testing.assert_allclose(vertices.min(axis=0), 0, atol=1e-6)
    np.testing.assert_allclose(vertices.max(axis=0), [10.0, 20.0, 30.0], rtol=1e-6)
    assert contents.unit is not None and DECLARED[contents.unit][0] == unit
    assert contents.notes == ()


@pytest.mark.parametrize("schema", SCHEMAS)
def test_every_protocol_is_read(schema: str) -> None:
    assert volume(read(box((1.0, 2.0, 3.0), schema=schema))) == pytest.approx(6.0, rel=1e-6)


@pytest.mark.parametrize(("name", "expected"), [("MILS", 0.0254), ("YARD", 914.4)])
def test_an_unusual_unit_is_converted_to_millimetres(name: str, expected: float) -> None:
    data = box(unit="inch").replace(b"'INCH'", f"'{name}'".encode()).replace(b"25.4", str(expected).encode())
    contents = read(data)
    assert contents.unit == "millimeter"
    assert joined(contents)[0].max() == pytest.approx(30 * expected, rel=1e-6)


def test_a_factor_in_metres_is_an_inch_too() -> None:
    # Creo and NX refer to the metre
    data = (
        box(unit="inch")
        .replace(b"25.4", b"0.0254")
        .replace(b"SI_UNIT(.MILLI.,.METRE.)", b"SI_UNIT($,.METRE.)")
    )
    contents = read(data)
    assert contents.unit == "inch"
    assert joined(contents)[0].max() == pytest.approx(30.0, rel=1e-6)


def test_a_file_without_unit_declares_none() -> None:
    assert read(re.sub(rb"GLOBAL_UNIT_ASSIGNED_CONTEXT\(\([^)]*\)\) ", b"", BOX)).unit is None


def test_triangles_lie_within_the_tolerance_and_close() -> None:
    radius, height = 50.0, 8.0
    contents = read(cylinder(radius, height))
    vertices, faces = joined(contents)
    side = faces[np.ptp(vertices[faces][..., 2], axis=1) > height / 2]
    middles = (vertices[side] + vertices[np.roll(side, 1, axis=1)]) / 2
    sagitta = radius - np.hypot(middles[..., 0], middles[..., 1])
    diagonal = math.sqrt(8 * radius**2 + height**2)
    assert len(side) and 0 < sagitta.max() <= 1.001 * TESSELLATION_SHARE * diagonal
    assert volume(contents) == pytest.approx(math.pi * radius**2 * height, rel=1e-3)
    assert "step_open_solid" not in codes(contents)


def test_the_same_bytes_give_the_same_triangles() -> None:
    first, second = (joined(read(cylinder())) for _ in range(2))
    for one, other in zip(first, second, strict=True):
        np.testing.assert_array_equal(one, other)


def test_every_triangle_has_its_face_of_the_cad_model() -> None:
    (body,) = read(BOX).bodies
    assert body.brep is not None
    assert [face.name for face in body.brep.faces] == [f"side {number}" for number in range(6)]
    planes = [
        (2, 0),
        (2, 30),
        (1, 0),
        (1, 20),
        (0, 0),
        (0, 10),
    ]  # axis and value, as in the file
    for number, (axis, at) in enumerate(planes):
        corners = body.vertices[body.faces[body.brep.of_triangle == number]]
        np.testing.assert_allclose(corners[..., axis], at, atol=1e-5)
    (pin,) = read(cylinder()).bodies
    assert pin.brep is not None
    assert [(face.name, face.kind) for face in pin.brep.faces] == [
        ("bottom", "plane"),
        ("top", "plane"),
        ("side", "cylinder"),
    ]


def test_the_faces_of_several_solids_are_told_apart() -> None:
    step = Step()
    solids = [step.solid(step.box_faces(SIZE, at), name) for at, name in ((0 * SIZE, "low"), (SIZE, "high"))]
    step.product("two", solids)
    bodies = read(step.text()).bodies
    assert [body.name for body in bodies] == ["low", "high"]
    assert all(body.brep is not None and len(body.brep.faces) == 6 for body in bodies)
    assert all(set(body.brep.of_triangle) == set(range(6)) for body in bodies if body.brep is not None)


def test_an_assembly_is_placed_and_its_parts_are_listed() -> None:
    made = Step()
    made.product("block", [made.solid(made.box_faces(SIZE))])
    made.product("pin", [made.solid(made.cylinder_faces(1.0, 2.0))])
    made.assembly(
        "all", [(0, np.array([10.0, 0, 0])), (0, np.array([20.0, 0, 0])), (1, np.array([0, 0, 50.0]))]
    )
    contents = read(made.text())
    assert [body.name for body in contents.bodies] == ["all.0", "all.1", "all.2"]
    lowest = [body.vertices.min(axis=0).round(3).tolist() for body in contents.bodies]
    np.testing.assert_allclose(lowest, [[10, 0, 0], [20, 0, 0], [-1, -1, 50]], atol=0.01)
    assert codes(contents) == ["several_parts"] and "1 all.0, 2 all.1, 3 all.2" in contents.notes[0].detail


def test_several_solids_of_one_part_are_listed_by_name() -> None:
    made = Step()
    faces = made.box_faces(SIZE), made.box_faces(SIZE, np.array([5.0, 0, 0]))
    made.product("pair", [made.solid(faces[0], "left"), made.solid(faces[1], "it''s right")])
    contents = read(made.text())
    assert codes(contents) == ["several_parts"]
    assert "2 parts (1 left, 2 it's right)" in contents.notes[0].detail
    assert volume(contents) == pytest.approx(12.0, rel=1e-6)
    right = choose_part(contents, "it's right")
    assert volume(right) == pytest.approx(6.0, rel=1e-6)
    assert joined(right)[0].min(axis=0) == pytest.approx([5.0, 0.0, 0.0], abs=1e-6)


def test_solids_that_touch_are_parts_of_their_own_and_a_cavity_is_none() -> None:
    """Two boxes with a common side, each of whose edges is in both; the second is hollow."""
    made = Step()
    left = made.solid(made.box_faces(SIZE), "left")
    hollow = made.hollow(
        made.box_faces(SIZE, np.array([1.0, 0, 0])), made.box_faces(SIZE / 2, SIZE / 4 + [1, 0, 0])
    )
    made.product("pair", [left, hollow, made.solid(made.cylinder_faces(1.0, 4.0), "pin")])
    contents = read(made.text())
    assert [body.name for body in contents.bodies] == ["left", "hollow", "pin"]
    volumes = [volume(Contents((body,))) for body in contents.bodies]
    assert volumes[:2] == pytest.approx([6.0, 6.0 - 6.0 / 8], rel=1e-6)
    assert volumes[2] == pytest.approx(4.0 * math.pi, rel=0.01)


def test_solids_of_several_products_are_numbered_by_product() -> None:
    made = Step()
    made.product("pair", [made.solid(made.box_faces(SIZE)), made.solid(made.box_faces(SIZE, 5 * SIZE))])
    made.product("pin", [made.solid(made.cylinder_faces(1.0, 2.0))])
    made.assembly("all", [(0, np.zeros(3)), (0, 50 * SIZE), (1, np.array([0, 0, 50.0]))])
    names = [body.name for body in read(made.text()).bodies]
    assert names == ["all.0 1", "all.0 2", "all.1 1", "all.1 2", "all.2"]


def test_a_solid_without_a_face_leaves_the_solids_of_its_product_together() -> None:
    made = Step()
    made.product(
        "pair", [made.solid(made.box_faces(SIZE)[:5], "a"), made.solid(made.box_faces(SIZE, 5 * SIZE), "b")]
    )
    contents = read(made.text())
    assert len(contents.bodies) == 1
    assert "2 solids (1 a, 2 b)" in contents.notes[0].detail and "export it alone" in contents.notes[0].detail


def test_hidden_solids_are_read_and_named() -> None:
    made = Step()
    shown = made.solid(made.box_faces(SIZE), "part")
    help_body = made.solid(made.box_faces(SIZE, np.array([5.0, 0, 0])), "jig")
    made.product("pair", [shown, help_body])
    style = made.add("PRESENTATION_STYLE_ASSIGNMENT((.NULL.))")
    styles = [made.add(f"STYLED_ITEM('',(#{style}),#{each})") for each in (shown, help_body)]
    made.add(f"INVISIBILITY((#{styles[1]}))")
    contents = read(made.text())
    assert volume(contents) == pytest.approx(12.0, rel=1e-6)
    assert codes(contents) == ["several_parts", "step_hidden"]
    assert "1 solid is hidden (jig) and was read" in contents.notes[1].detail


def test_surfaces_without_a_solid_are_read_and_named() -> None:
    made = Step()
    sheet = made.surface(made.box_faces(SIZE)[:5])
    made.product("sheet", [sheet], "MANIFOLD_SURFACE_SHAPE_REPRESENTATION")
    contents = read(made.text())
    assert len(joined(contents)[1]) == 10
    assert codes(contents) == ["step_surfaces"] and "1 surface model and no solid" in contents.notes[0].detail


@pytest.mark.parametrize("change", ["surface", "bound"])
def test_a_face_that_is_damaged_is_said_to_be_missing(change: str) -> None:
    """Open CASCADE leaves it out without a word."""
    if change == "surface":
        data = re.sub(rb"PLANE\('',(#\d+)\)", rb"CYLINDRICAL_SURFACE('',\1,5.)", BOX, count=1)
    else:
        data = re.sub(rb"(ADVANCED_FACE\('side 2',)\(#\d+\)", rb"\1()", BOX)
    contents = read(data)
    assert len(joined(contents)[1]) == 10
    assert codes(contents) == ["step_open_solid"] and "open edges" in contents.notes[0].detail


DIALECTS = {
    "CRLF": BOX.replace(b"\n", b"\r\n"),
    "one line": BOX.replace(b"\n", b""),
    "byte order mark": b"\xef\xbb\xbf" + BOX,
    "blank lines before": b"\n \n" + BOX,
    "comment before": b"/* made * by * hand **/\n" + BOX,
    "spaces": BOX.replace(b"=", b" = ").replace(b"(#", b"( #"),
}


@pytest.mark.parametrize("name", DIALECTS)
def test_other_layouts_of_the_text_give_the_same(name: str) -> None:
    data = DIALECTS[name]
    assert detect_format(data[:4096], len(data)) == Format.STEP
    contents = read(data)
    assert contents.unit == "millimeter" and volume(contents) == pytest.approx(6000.0, rel=1e-6)


@pytest.mark.parametrize("share", [0.02, 0.3, 0.7, 0.95, 0.999])
def test_a_cut_file_is_named_with_its_last_line(share: float) -> None:
    cut = BOX[: int(share * len(BOX)) - 10]
    last = cut.count(b"\n") + 1
    with pytest.raises(errors.TruncatedFile, match=f"ends in line {last} "):
        read(cut)


def test_a_syntax_error_is_named_with_its_line_where_open_cascade_says_so() -> None:
    lines = BOX.split(b"\n")
    assert lines[6] == b"DATA;"
    with pytest.raises(
        errors.UnreadableFile, match=r"syntax error at or before line 178: unexpected ENDSTEP"
    ):
        read(b"\n".join([*lines[:6], b"HEADER;", *lines[7:]]))
    lines[40] = lines[40].replace(b";", b"")
    with pytest.raises(errors.UnreadableFile, match=r"syntax errors: 1"):
        read(b"\n".join(lines))


def test_references_to_nothing_are_refused_though_open_cascade_may_crash() -> None:
    lines = BOX.split(b"\n")
    without = [line for line in lines if not line.startswith(b"#24=")]
    assert len(without) == len(lines) - 1
    with pytest.raises(
        errors.UnreadableFile, match=r"1 of its entities refer to entities that are not in the"
    ):
        read(b"\n".join(without))


def test_a_file_without_surface_says_so() -> None:
    made = Step()
    made.product("nothing", [], "SHAPE_REPRESENTATION")
    with pytest.raises(errors.UnreadableFile, match="no solids and no surfaces"):
        read(made.text())
    made.add("DOCUMENT_FILE('wheel.stp','','',#1,'',$)")
    with pytest.raises(errors.UnreadableFile, match="refers to 1 other files"):
        read(made.text())


def test_a_solid_that_no_product_refers_to_is_not_read_as_nothing() -> None:
    made = Step()
    made.solid(made.box_faces(SIZE))
    with pytest.raises(errors.UnreadableFile, match="none of the 1 solids"):
        read(made.text())


def test_a_building_model_is_refused_by_name() -> None:
    with pytest.raises(errors.UnreadableFile, match=r"building model \(IFC4X3\)"):
        read(BOX.replace(b"AUTOMOTIVE_DESIGN { 1 0 10303 214 1 1 1 1 }", b"IFC4X3"))


def test_a_part_too_far_for_single_precision_is_refused() -> None:
    made = Step()
    made.product("far", [made.solid(made.box_faces(SIZE, np.array([1e7, 0, 0])))])
    with pytest.raises(errors.UnreadableFile, match=r"1e\+07 mm from the origin, .* rounded by 0\.6 mm"):
        read(made.text())


def test_too_many_triangles_are_refused() -> None:
    with pytest.raises(errors.MeshTooLarge):
        read(cylinder(), max_faces=50)


def test_without_the_package_the_error_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        extras, "find_spec", lambda name: None if name == "cascadio" else util.find_spec(name)
    )
    with pytest.raises(errors.UnreadableFile) as refused:
        read(BOX)
    assert (
        "cascadio" in refused.value.reason
        and "`pip install cascadio` (the extra `step` of Cusp)" in refused.value.remedy
    )


ENDS = {
    "import os; os.kill(os.getpid(), 11)": (errors.UnreadableFile, "SIGSEGV"),
    "import os; os.kill(os.getpid(), 9)": (MemoryError, "memory"),
    "print(\"terminate after throwing an instance of 'std::bad_alloc'\", file=sys.stderr); sys.exit(134)": (
        MemoryError,
        "memory",
    ),
    "raise RuntimeError('no')": (errors.UnreadableFile, "RuntimeError: no"),
    "sys.stdin.buffer.read(8); sys.exit(7)": (errors.UnreadableFile, "code 7"),
}


@pytest.mark.parametrize("end", ENDS)
def test_a_crash_and_a_lack_of_memory_are_told_apart(
    end: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    program = tmp_path / "program.py"
    program.write_text(f"import sys\n{end}\n")
    monkeypatch.setattr(step_process, "PROGRAM", program)
    kind, words = ENDS[end]
    with pytest.raises(kind, match=words):
        read(BOX)


@given(
    st.integers(0, len(BOX)),
    st.sampled_from([b"", b"#", b"'", b"(", b";", b"\xff", b"#999999", b"$"]),
    st.integers(0, 9),
)
def test_a_changed_text_is_scanned_or_refused(at: int, evil: bytes, lost: int) -> None:
    try:
        found = read_step_text(BOX[:at] + evil + BOX[at + lost :])
    except errors.PipelineError as refused:
        assert refused.reason and refused.remedy
    else:
        assert found.unit is None or found.unit in DECLARED


@settings(max_examples=6, suppress_health_check=[HealthCheck.too_slow], deadline=None)
@given(
    st.integers(300, len(BOX)),
    st.sampled_from([b"", b"#7", b"$", b"(", b"1.E400", b"-1", b"*"]),
    st.integers(1, 9),
)
def test_a_changed_file_is_read_or_refused(at: int, evil: bytes, lost: int) -> None:
    try:
        contents = read(BOX[:at] + evil + BOX[at + lost :])
    except errors.PipelineError as refused:
        assert refused.reason and refused.remedy
    else:
        joined(contents)


def test_the_first_tessellation_is_coarse_and_the_second_is_not(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[float] = []
    original = Tessellation.glb
    monkeypatch.setattr(Tessellation, "glb", lambda self, mm: (asked.append(mm), original(self, mm))[1])
    read(BOX)
    assert asked[1] == pytest.approx(TESSELLATION_SHARE * math.sqrt(1400), rel=1e-6)
