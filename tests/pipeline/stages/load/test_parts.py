"""One part of a file with several is read when it is named or numbered; else all of them, with a list."""

from pathlib import Path

import numpy as np
import pytest
import trimesh

from pipeline import MeshFile, errors
from pipeline.analysis.design_model import fingerprint
from pipeline.core.settings import LoadSettings, Settings
from pipeline.stages.load import Loaded, load
from pipeline.stages.load.contents import Body, Contents, FilePart
from pipeline.stages.load.parts import choose_part
from tests.support import shapes

#: Boxes apart, each with a volume of its own.
SIZES = {"bracket": (1.0, 1.0, 1.0), "cover": (2.0, 2.0, 2.0), "pin 3": (3.0, 3.0, 3.0)}


def _obj() -> bytes:
    lines, start = [], 1
    for at, (name, size) in enumerate(SIZES.items()):
        box = shapes.box(size)
        lines.append(f"o {name}")
        lines += [f"v {x + 10 * at} {y} {z}" for x, y, z in box.vertices]
        lines += [f"f {a + start} {b + start} {c + start}" for a, b, c in box.faces]
        start += len(box.vertices)
    return "\n".join(lines).encode()


def _stl() -> bytes:
    text = ""
    for at, (name, size) in enumerate(SIZES.items()):
        box = shapes.box(size)
        text += f"solid {name}\n"
        for corners in box.vertices[box.faces] + [10.0 * at, 0, 0]:
            text += "facet normal 0 0 0\nouter loop\n"
            text += "".join(f"vertex {x} {y} {z}\n" for x, y, z in corners) + "endloop\nendfacet\n"
        text += f"endsolid {name}\n"
    return text.encode()


def _scene(kind: str) -> bytes:
    scene = trimesh.Scene()
    for at, (name, size) in enumerate(SIZES.items()):
        box = shapes.box(size)
        mesh = trimesh.Trimesh(box.vertices + np.array([10.0 * at, 0, 0]), box.faces, process=False)
        scene.add_geometry(mesh, node_name=name, geom_name=name)
    exported = scene.export(file_type=kind)
    assert isinstance(exported, bytes)
    return exported


FILES = {"obj": _obj, "stl": _stl, "glb": lambda: _scene("glb"), "3mf": lambda: _scene("3mf")}


FILES["obj groups"] = lambda: _obj().replace(b"o ", b"g ")


def read(tmp_path: Path, kind: str, part: str | None) -> Loaded:
    path = tmp_path / f"parts.{kind.split()[0]}"
    path.write_bytes(FILES[kind]())
    return load(MeshFile(path, unit="mm", part=part), "design", LoadSettings(), needs_surface=True)


def sizes(loaded: Loaded) -> list[float]:
    """Edge lengths of the boxes that were read, by their areas."""
    owner = loaded.body_of_face
    owner = np.zeros(len(loaded.mesh.faces), dtype=np.int32) if owner is None else owner
    areas = np.bincount(owner, weights=loaded.mesh.face_areas_mm2())
    return [round(float(np.sqrt(area / 6.0)), 6) for area in areas]


@pytest.mark.parametrize("kind", FILES)
def test_all_parts_are_read_and_listed(kind: str, tmp_path: Path) -> None:
    for part in (None, "all"):
        loaded = read(tmp_path, kind, part)
        assert sizes(loaded) == [1.0, 2.0, 3.0]
        (note,) = [note for note in loaded.notes if note.code == "several_parts"]
        assert "1 bracket, 2 cover, 3 pin 3" in note.detail


@pytest.mark.parametrize("kind", FILES)
@pytest.mark.parametrize(
    ("part", "expected"),
    [
        ("cover", [2.0]),
        ("COVER", [2.0]),
        ("2", [2.0]),
        ("pin 3", [3.0]),
        ("3", [3.0]),
        ("1,3", [1.0, 3.0]),
    ],
)
def test_a_part_is_chosen_by_name_or_number(
    kind: str, part: str, expected: list[float], tmp_path: Path
) -> None:
    loaded = read(tmp_path, kind, part)
    assert sizes(loaded) == expected
    codes = [note.code for note in loaded.notes]
    assert "design_part" in codes and "several_parts" not in codes


@pytest.mark.parametrize("part", ["lid", "4", "0", "1,9", "pin", "-1"])
def test_an_unknown_part_is_refused_with_the_list(part: str, tmp_path: Path) -> None:
    with pytest.raises(errors.PartNotFound, match=r"1 bracket, 2 cover, 3 pin 3.*options\.design_part"):
        read(tmp_path, "obj", part)


def test_a_name_of_several_parts_needs_the_number(tmp_path: Path) -> None:
    path = tmp_path / "same.stl"
    path.write_bytes(_stl().replace(b"cover", b"bracket"))
    with pytest.raises(errors.PartNotFound, match="2 parts are named 'bracket': 1 bracket, 2 bracket"):
        load(MeshFile(path, part="bracket"), "design", LoadSettings(), needs_surface=True)
    assert sizes(load(MeshFile(path, part="2"), "design", LoadSettings(), needs_surface=True)) == [2.0]


def test_a_component_of_the_only_part_is_chosen() -> None:
    part = FilePart(0, "assembly")
    bodies = tuple(
        Body(shapes.box(size).vertices, shapes.box(size).faces.astype(np.int64), name, part)
        for name, size in SIZES.items()
    )
    assert choose_part(Contents(bodies), None).notes == ()
    assert [body.name for body in choose_part(Contents(bodies), "cover").bodies] == ["cover"]
    assert [body.name for body in choose_part(Contents(bodies), "3").bodies] == ["pin 3"]
    with pytest.raises(errors.PartNotFound, match="1 bracket, 2 cover, 3 pin 3"):
        choose_part(Contents(bodies), "assembly 2")


def test_groups_of_one_closed_surface_are_one_part(tmp_path: Path) -> None:
    box = shapes.box()
    lines = [f"v {x} {y} {z}" for corners in box.vertices[box.faces] for x, y, z in corners]
    for face in range(len(box.faces)):
        lines += [f"g face{face // 2}", f"f {3 * face + 1} {3 * face + 2} {3 * face + 3}"]
    path = tmp_path / "faces.obj"
    path.write_text("\n".join(lines))
    loaded = load(MeshFile(path), "design", LoadSettings(), needs_surface=True)
    assert loaded.notes == () and loaded.body_of_face is None


def test_a_name_counts_before_a_number(tmp_path: Path) -> None:
    path = tmp_path / "numbers.stl"
    path.write_bytes(_stl().replace(b"bracket", b"3"))
    assert sizes(load(MeshFile(path, part="3"), "design", LoadSettings(), needs_surface=True)) == [1.0]


def test_the_model_of_another_part_is_another_model(tmp_path: Path) -> None:
    path = tmp_path / "parts.obj"
    path.write_bytes(_obj())
    prints = {fingerprint(MeshFile(path, part=part), Settings(), 0) for part in (None, "1", "2")}
    assert len(prints) == 3
