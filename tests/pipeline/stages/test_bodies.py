"""Bodies that meet become one surface of the area and volume that the formula gives, and cavities stay."""

import hashlib
import os
import subprocess
import sys

import manifold3d
import numpy as np
import pytest

from pipeline.core.mesh import FloatArray, Mesh
from pipeline.core.settings import CleanSettings
from pipeline.kernels import topology
from pipeline.stages.clean import Cleaned, clean
from tests.support import shapes

#: A rotation about no axis of the boxes: coordinates in single precision no longer lie in common planes.
ROTATION = shapes.motion(3)[:3, :3]


def box(low: tuple[float, ...], high: tuple[float, ...], *, inwards: bool = False) -> Mesh:
    size = np.subtract(high, low)
    unit = shapes.box()
    faces = unit.faces[:, ::-1] if inwards else unit.faces
    return Mesh(unit.vertices * size + np.array(low), faces)


def soup(*meshes: Mesh, rotation: FloatArray | None = None) -> Mesh:
    """All bodies as one STL holds them: triangles without order, in single precision."""
    corners = np.concatenate([mesh.vertices[mesh.faces] for mesh in meshes]).reshape(-1, 3)
    if rotation is not None:
        corners = corners @ rotation.T
    corners = corners.astype(np.float32).astype(np.float64)
    return Mesh(corners, np.arange(len(corners)).reshape(-1, 3))


def volume_mm3(mesh: Mesh) -> float:
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    return float(np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6.0)


CUBE = box((0, 0, 0), (10, 10, 10))
KNOB = box((10, 2, 2), (15, 8, 8))  # on the side of the cube
HOLE = box((3, 3, 3), (7, 7, 7), inwards=True)
CASES = {
    "one body": ([CUBE], 600, 1000, 0, 0),
    "overlapping": ([CUBE, box((5, 5, 5), (15, 15, 15))], 1050, 1875, 2, 150),
    "the whole side in common": ([CUBE, box((10, 0, 0), (20, 10, 10))], 1000, 2000, 2, 200),
    "a part of the side in common": ([CUBE, KNOB], 720, 1180, 2, 72),
    "a row of three": (
        [CUBE, box((10, 0, 0), (20, 10, 10)), box((20, 0, 0), (30, 10, 10))],
        1400,
        3000,
        3,
        400,
    ),
    "an edge in common": ([CUBE, box((10, 10, 0), (20, 20, 10))], 1200, 2000, 0, 0),
    "apart": ([CUBE, box((20, 2, 2), (25, 8, 8))], 792, 1180, 0, 0),
    "a cavity": ([CUBE, HOLE], 696, 936, 0, 0),
    "a body within a body": ([CUBE, box((3, 3, 3), (7, 7, 7))], 600, 1000, 2, 96),
    "a body loose in a cavity": ([CUBE, HOLE, box((4, 4, 4), (6, 6, 6))], 720, 944, 0, 0),
    "a hollow body and a knob": ([CUBE, HOLE, KNOB], 816, 1116, 2, 72),
    "the knob inside out": (
        [CUBE, box((10, 2, 2), (15, 8, 8), inwards=True)],
        720,
        1180,
        2,
        72,
    ),
    "a hollow body inside out, and a knob": (
        [box((0, 0, 0), (10, 10, 10), inwards=True), box((3, 3, 3), (7, 7, 7)), KNOB],
        816,
        1116,
        2,
        72,
    ),
    "the same body twice": ([CUBE, CUBE], 600, 1000, 2, 600),
    "the same bottom": ([box((0, 0, 0), (10, 10, 1)), box((0, 0, 0), (10, 10, 5))], 400, 500, 2, 240),
}


def cleaned(mesh: Mesh) -> Cleaned:
    return clean(mesh, "design", CleanSettings())


@pytest.mark.parametrize("rotation", [None, ROTATION], ids=["along the axes", "rotated"])
@pytest.mark.parametrize("case", CASES)
def test_the_union_has_the_area_and_the_volume_of_the_formula(case: str, rotation: FloatArray | None) -> None:
    bodies, area_mm2, volume, n_united, internal_mm2 = CASES[case]
    found = cleaned(soup(*bodies, rotation=rotation))
    assert found.mesh.face_areas_mm2().sum() == pytest.approx(area_mm2, rel=1e-5)
    assert volume_mm3(found.mesh) == pytest.approx(volume, rel=1e-5)
    assert found.report.get("united_bodies", 0) == n_united
    assert found.report.get("internal_area_mm2", 0.0) == pytest.approx(internal_mm2, rel=1e-4)
    assert (topology.edges(found.mesh.faces).count == 2).all()
    assert found.report["non_manifold_faces"] == 0


def check_assembly(seed: int) -> None:
    """Up to six boxes at whole coordinates meet in every way; the area and the volume are those of voxels."""
    rng = np.random.default_rng(seed)
    n, bodies = 8, []
    voxels = np.zeros((n + 2,) * 3, dtype=np.bool_)
    for _ in range(rng.integers(2, 7)):
        low = rng.integers(0, n - 1, 3)
        high = np.minimum(low + rng.integers(1, 5, 3), n)
        voxels[tuple(slice(a + 1, b + 1) for a, b in zip(low, high, strict=True))] = True
        bodies.append(box(tuple(low), tuple(high)))
    area_mm2 = sum(int(np.abs(np.diff(voxels.astype(int), axis=k)).sum()) for k in range(3))
    found = cleaned(soup(*bodies, rotation=ROTATION if seed % 2 else None))
    assert found.mesh.face_areas_mm2().sum() == pytest.approx(area_mm2, rel=1e-4)
    assert volume_mm3(found.mesh) == pytest.approx(voxels.sum(), rel=1e-4)
    assert (topology.edges(found.mesh.faces).count == 2).all()


@pytest.mark.parametrize("seed", range(60))
def test_any_assembly_of_boxes_has_the_area_and_volume_of_its_voxels(seed: int) -> None:
    check_assembly(seed)


@pytest.mark.nightly
@pytest.mark.parametrize("first", range(60, 1500, 60))
def test_many_assemblies_of_boxes_have_the_area_and_volume_of_their_voxels(first: int) -> None:
    for seed in range(first, first + 60):
        check_assembly(seed)


def test_far_from_the_origin_the_union_is_the_same() -> None:
    near = cleaned(soup(CUBE, KNOB)).mesh
    far = cleaned(Mesh(soup(CUBE, KNOB).vertices + 1e7, soup(CUBE, KNOB).faces)).mesh
    np.testing.assert_array_equal(near.faces, far.faces)
    np.testing.assert_allclose(far.vertices - 1e7, near.vertices, atol=1e-6)


def test_a_thin_cavity_of_a_body_that_meets_another_stays() -> None:
    slot = box((3, 3, 5), (7, 7, 5.002), inwards=True)  # thinner than voids that are filled
    found = cleaned(soup(CUBE, slot, KNOB))
    assert found.mesh.face_areas_mm2().sum() == pytest.approx(720 + 2 * 16 + 4 * 4 * 0.002, rel=1e-6)
    assert found.report["filled_voids"] == 0


def test_without_the_setting_walls_stay() -> None:
    found = clean(soup(CUBE, KNOB), "design", CleanSettings(unite_bodies=False))
    assert found.mesh.face_areas_mm2().sum() == pytest.approx(600 + 192)


def test_vertices_of_the_file_are_still_named_and_new_ones_are_not() -> None:
    mesh = soup(CUBE, KNOB, box((40, 0, 0), (50, 10, 10)))
    found = cleaned(mesh)
    old = found.old_of_new >= 0
    assert old.sum() == 8  # those of the box that nothing touches
    np.testing.assert_array_equal(mesh.vertices[found.old_of_new[old]], found.mesh.vertices[old])


def test_an_open_body_is_kept_as_it_is_and_counted() -> None:
    found = cleaned(soup(CUBE, Mesh(KNOB.vertices, KNOB.faces[2:])))
    assert found.report["bodies_not_united"] == 1
    assert found.mesh.face_areas_mm2().sum() >= 600 + 192 - 36


def test_open_pieces_of_a_scan_are_not_touched() -> None:
    plane = shapes.grid_plane(6, 6)
    upright = plane.vertices @ np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])
    crossing = Mesh(upright + np.array([0.5, 2.5, -2.5]), plane.faces)
    mesh = soup(plane, crossing)
    found = clean(mesh, "scan", CleanSettings())
    assert len(found.mesh.faces) == len(mesh.faces)
    assert "united_bodies" not in found.report


def test_a_pin_that_fills_a_round_hole_leaves_hardly_a_wall() -> None:
    """A disc with a hole and a pin in it, with 64 and 96 sides: slits of 6 micrometres are open."""

    def solid(outer: int, inner: int | None) -> Mesh:
        made = manifold3d.Manifold.cylinder(10.0, 20.0, 20.0, outer)
        if inner is None:
            made = manifold3d.Manifold.cylinder(10.0, 5.0, 5.0, outer)
        else:
            made -= manifold3d.Manifold.cylinder(10.0, 5.0, 5.0, inner)
        found = made.to_mesh64()
        return Mesh(np.asarray(found.vert_properties), np.asarray(found.tri_verts).astype(np.int32))

    disc, pin = solid(256, 64), solid(96, None)
    found = cleaned(soup(disc, pin))
    whole_mm2 = 2 * (0.5 * 256 * 20.0**2 * np.sin(2 * np.pi / 256)) + 10 * 256 * 40 * np.sin(np.pi / 256)
    walls_mm2 = 2 * 10 * 2 * np.pi * 5.0
    assert found.mesh.face_areas_mm2().sum() < whole_mm2 + 0.15 * walls_mm2


def _digest() -> str:
    found = cleaned(soup(*CASES["a hollow body and a knob"][0], rotation=ROTATION))
    return hashlib.sha256(found.mesh.vertices.tobytes() + found.mesh.faces.tobytes()).hexdigest()


def test_the_bytes_are_the_same_in_another_process_on_one_core() -> None:
    one_core = sorted(os.sched_getaffinity(0))[:1]
    script = (
        f"import os; os.sched_setaffinity(0, {one_core})\nfrom {__name__} import _digest; print(_digest())"
    )
    other = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert other.stdout.strip() == _digest()
