"""Isotropic remeshing: the surface, its lines and its topology stay; the edges get the length asked for."""

from itertools import pairwise

import numpy as np
import pytest
import trimesh

from pipeline.core.mesh import FloatArray, Mesh
from pipeline.kernels import remesh, topology
from pipeline.kernels.isotropic import remeshed
from pipeline.kernels.native import core
from pipeline.kernels.surface import Surface
from tests.support import shapes

PARTS = {
    "blob": (shapes.bumpy_blob(4), 2.0),
    "torus": (shapes.torus(20.0, 6.0, 90, 40), 1.7),
    "gear": (shapes.gear(12), 1.5),
    "sphere": (shapes.icosphere(20.0, 3), 2.0),
}


def euler(mesh: Mesh) -> int:
    return len(mesh.vertices) - len(topology.edges(mesh.faces).ends) + len(mesh.faces)


def quality(mesh: Mesh) -> FloatArray:
    """(m,) 1 for an equilateral triangle, 0 without area."""
    corners = mesh.vertices[mesh.faces]
    squared = ((corners - np.roll(corners, 1, axis=1)) ** 2).sum(axis=(1, 2))
    return np.asarray(4 * np.sqrt(3.0) * mesh.face_areas_mm2() / squared)


@pytest.mark.parametrize("name", PARTS)
def test_edges_are_as_long_as_asked_and_triangles_nearly_equilateral(name: str) -> None:
    part, edge_mm = PARTS[name]
    found = remeshed(part, edge_mm, 5)
    assert remesh.edge_mm(found, 0.5) == pytest.approx(edge_mm, rel=0.06)
    assert np.median(quality(found)) > 0.95


@pytest.mark.parametrize("name", PARTS)
def test_the_surface_and_its_topology_stay(name: str) -> None:
    part, edge_mm = PARTS[name]
    found = remeshed(part, edge_mm, 5)
    assert (topology.edges(found.faces).count == 2).all()
    assert topology.is_coherent(found.faces)
    assert euler(found) == euler(part)
    assert Surface(part).closest(found.vertices).distance.max() < 1e-9 * part.diagonal_mm
    assert np.sqrt((Surface(found).closest(part.vertices).distance ** 2).mean()) < 0.1 * edge_mm


@pytest.mark.parametrize("name", PARTS)
def test_as_near_to_the_surface_as_another_implementation(name: str) -> None:
    """pymeshlab's remeshing by the same method: this one is at most a fifth farther off."""
    part, edge_mm = PARTS[name]

    def off_mm(mesh: Mesh) -> float:
        return float(np.sqrt((Surface(mesh).closest(part.vertices).distance ** 2).mean()))

    other = remesh.isotropic(part, edge_mm, 5)
    found = remeshed(part, edge_mm, 5)
    sag_mm = edge_mm**2 / 8 / part.diagonal_mm  # finer than what either can resolve on a part so curved
    assert (
        off_mm(found) < 1.2 * off_mm(other) * remesh.edge_mm(found, 0.5) / remesh.edge_mm(other, 0.5) + sag_mm
    )
    assert np.median(quality(found)) > np.median(quality(other)) - 0.01


def test_a_box_stays_a_box() -> None:
    box = shapes.box((6.0, 4.0, 2.0))
    found = remeshed(box, 0.4, 5)
    low, high = box.vertices.min(axis=0), box.vertices.max(axis=0)
    on_faces = np.isclose(found.vertices, low, atol=1e-12) | np.isclose(found.vertices, high, atol=1e-12)
    assert on_faces.any(axis=1).all()
    corners = {tuple(v) for v in box.vertices}
    assert corners <= {tuple(v) for v in found.vertices}
    assert found.face_areas_mm2().sum() == pytest.approx(box.face_areas_mm2().sum(), rel=1e-12)
    assert len(found.faces) == pytest.approx(88 / (np.sqrt(3) / 4 * 0.4**2), rel=0.15)


def test_an_open_border_stays_on_its_line() -> None:
    plane = shapes.grid_plane(31, 21)
    found = remeshed(plane, 2.5 * remesh.edge_mm(plane, 0.5), 5)
    assert found.face_areas_mm2().sum() == pytest.approx(plane.face_areas_mm2().sum(), rel=1e-12)
    border = topology.border_vertices(found.faces, len(found.vertices))
    inside = (found.vertices > plane.vertices.min(axis=0)) & (found.vertices < plane.vertices.max(axis=0))
    assert not inside[border][:, :2].all(axis=1).any()


def test_a_round_rim_is_followed_by_corners_that_lie_on_it() -> None:
    tube = shapes.cylinder()
    rim = Mesh(tube.vertices, tube.faces)
    found = remeshed(rim, 1.4 * remesh.edge_mm(rim, 0.5), 5)
    assert Surface(rim).closest(found.vertices).distance.max() < 1e-9 * rim.diagonal_mm


def test_fewer_creases_for_a_larger_angle() -> None:
    """Without any crease, the edges of a box are rounded off; with them they are kept."""
    box = shapes.box((6.0, 4.0, 2.0), 3)
    area = box.face_areas_mm2().sum()
    rounded = remeshed(box, 0.7, 5, crease_deg=180.0).face_areas_mm2().sum()
    assert rounded < 0.999 * area
    assert remeshed(box, 0.7, 5, crease_deg=30.0).face_areas_mm2().sum() == pytest.approx(area, rel=1e-12)


def test_both_sides_of_a_thin_wall_stay_apart() -> None:
    """A plate whose thickness is a tenth of an edge."""
    plate = shapes.box((10.0, 10.0, 0.1), 3)
    found = remeshed(plate, 1.0, 5)
    normals = found.face_cross_mm2()
    centres = found.vertices[found.faces].mean(axis=1)
    top = np.isclose(centres[:, 2], plate.vertices[:, 2].max())
    bottom = np.isclose(centres[:, 2], plate.vertices[:, 2].min())
    assert top.sum() > 100 and bottom.sum() > 100
    assert (normals[top, 2] > 0).all() and (normals[bottom, 2] < 0).all()


def test_bodies_that_touch_in_a_vertex_stay_as_they_are() -> None:
    box = shapes.box((2.0, 2.0, 2.0))
    other = box.vertices + (box.vertices.max(axis=0) - box.vertices.min(axis=0))
    shared = int(np.flatnonzero((box.vertices == box.vertices.max(axis=0)).all(axis=1))[0])
    twin = int(np.flatnonzero((other == box.vertices.max(axis=0)).all(axis=1))[0])
    second = box.faces + len(box.vertices)
    second[second == twin + len(box.vertices)] = shared
    both = Mesh(np.concatenate([box.vertices, other]), np.concatenate([box.faces, second]).astype(np.int32))
    found = remeshed(both, 0.5, 3)
    assert found.face_areas_mm2().sum() == pytest.approx(48.0, rel=1e-12)
    assert (found.vertices == box.vertices[shared]).all(axis=1).sum() == 2  # a copy each


def test_a_band_with_one_side_is_cut_not_torn() -> None:
    """A Moebius band has no coherent orientation: one of its edges is a border."""
    turn = np.linspace(0, 2 * np.pi, 60, endpoint=False)
    half = np.array([-1.0, 0.0, 1.0])
    radius = 10 + np.outer(np.cos(turn / 2), half)
    vertices = np.stack(
        [radius * np.cos(turn)[:, None], radius * np.sin(turn)[:, None], np.outer(np.sin(turn / 2), half)],
        axis=2,
    )
    faces = []
    for k in range(60):
        for j in range(2):
            a, b = 3 * k + j, 3 * k + j + 1
            c, d = (3 * k + 3 + j, 3 * k + 4 + j) if k < 59 else (2 - j, 1 - j)
            faces += [[a, c, b], [b, c, d]]
    band = Mesh(vertices.reshape(-1, 3), np.array(faces, dtype=np.int32))
    found = remeshed(band, 0.8, 5)
    assert found.face_areas_mm2().sum() == pytest.approx(band.face_areas_mm2().sum(), rel=0.01)


def test_the_same_bytes_with_any_number_of_threads() -> None:
    part, edge_mm = PARTS["blob"]
    one, four = (core.isotropic(part.vertices, part.faces, edge_mm, 30.0, 3, n) for n in (1, 4))
    assert one[0].tobytes() == four[0].tobytes()
    assert one[1].tobytes() == four[1].tobytes()


def test_bad_arrays_are_refused() -> None:
    part = shapes.box()
    with pytest.raises(IndexError):
        core.isotropic(part.vertices, part.faces + 100, 1.0, 30.0, 1, 1)
    with pytest.raises(ValueError, match="positive"):
        core.isotropic(part.vertices, part.faces, 0.0, 30.0, 1, 1)
    with pytest.raises(ValueError, match="m > 0"):
        core.isotropic(part.vertices, part.faces[:0], 1.0, 30.0, 1, 1)


def test_a_chamfer_far_narrower_than_the_edges_leaves_no_needles() -> None:
    """Its two creases are closer than a tenth of the length asked for: they become one."""
    width = 0.04
    corners = np.array([[x, y] for x, y in ((0, 0), (10, 0), (10, 10 - width), (10 - width, 10), (0, 10))])
    points = np.concatenate([np.column_stack([corners, np.full(5, z)]) for z in (0.0, 10.0)])
    hull = trimesh.convex.convex_hull(points)
    part = Mesh(np.asarray(hull.vertices), np.asarray(hull.faces))
    found = remeshed(part, 1.0, 5)
    ends = found.vertices[topology.edges(found.faces).ends]
    assert np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1).min() > 0.1
    assert quality(found).min() > 0.1
    assert (topology.edges(found.faces).count == 2).all()
    assert euler(found) == 2
    assert Surface(part).closest(found.vertices).distance.max() < width


def test_two_triangles_that_share_all_edges_stay_a_closed_surface() -> None:
    """Splitting and collapsing them leaves two that share two edges, whose collapse wrote beside an array."""
    corners = [[32.0, 3.0, -143.0], [28.0, -3.0, 60.0], [22.0, -10.0, 60.0]]
    apart = [[-28.0, 5.0, -13.0], [-26.0, 1.0, -25.0], [-28.0, 5.0, 60.0]]
    mesh = Mesh(np.array([*corners, *apart]), np.array([[2, 0, 1], [2, 1, 0], [3, 4, 5]], dtype=np.int32))
    found = remeshed(mesh, 102.0, 5, crease_deg=60.0)
    pillow = found.faces[found.vertices[found.faces][:, :, 0].min(axis=1) > 0]
    assert len(pillow) and (topology.edges(pillow).count % 2 == 0).all()
    assert Surface(mesh).closest(found.vertices).distance.max() < 1e-9


def disc_with_chamfered_hole(sides: int = 120) -> Mesh:
    """A disc of radius 40 mm, 20 mm thick, with a square hole whose edges are chamfered; in few triangles, as
    CAD gives them: fans of needles from the corners of the hole.
    """
    angle = 2 * np.pi * np.arange(sides) / sides
    circle = 40 * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    square = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]], dtype=np.float64)
    rings = [(circle, -10), (circle, 10), (26 * square, -10), (26 * square, 10)]
    rings += [(23 * square, -7), (23 * square, 7)]
    vertices = np.concatenate([np.column_stack([ring, np.full(len(ring), z)]) for ring, z in rings])
    low, high, low_edge, high_edge, low_wall, high_wall = np.cumsum([0, sides, sides, 4, 4, 4])
    bands = [(low, high, sides), (low_wall, low_edge, 4), (high_wall, low_wall, 4), (high_edge, high_wall, 4)]
    faces: list[list[int]] = []
    for a, b, n in bands:
        for i in range(n):
            j = (i + 1) % n
            faces += [[a + i, a + j, b + j], [a + i, b + j, b + i]]
    quarter = sides // 4
    for rim, edge, turn in ((high, high_edge, 1), (low, low_edge, -1)):
        for k in range(4):
            ends = [rim + (k * quarter + i) % sides for i in range(quarter + 1)]
            fan = [[*pair, edge + k] for pair in pairwise(ends)]
            faces += [face[::turn] for face in (*fan, [edge + k, ends[-1], edge + (k + 1) % 4])]
    return Mesh(vertices, np.array(faces, dtype=np.int32))


@pytest.mark.parametrize("crease_deg", [30.0, 60.0])
def test_no_edge_is_flipped_across_a_chamfer(crease_deg: float) -> None:
    """Long needles at a chamfer of 45 degrees: the other diagonal goes through the part, 5 mm deep."""
    part = disc_with_chamfered_hole()
    found = remeshed(part, 2.0, 5, crease_deg=crease_deg)
    assert Surface(part).closest(found.vertices).distance.max() < 1e-9 * part.diagonal_mm
    middles = found.vertices[found.faces].mean(axis=1)
    assert Surface(part).closest(middles).distance.max() < 0.5 * 2.0
