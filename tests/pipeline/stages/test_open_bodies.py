"""Triangles deep within a body with small holes are those that a formula says, and no others."""

import numpy as np
import pytest

from pipeline.core.mesh import Mesh
from pipeline.core.settings import CleanSettings
from pipeline.kernels import topology
from pipeline.stages.clean import clean
from pipeline.stages.open_bodies import MAX_HOLE_SHARE, MIN_DEPTH_SHARE, within_others
from tests.support import shapes

RADIUS_MM = 10.0


def ball(x_mm: float, radius_mm: float = RADIUS_MM, *, lost: int = 0, inwards: bool = False) -> Mesh:
    """A ball about (x, 0, 0), without its `lost` lowest triangles."""
    mesh = shapes.icosphere(radius_mm, 4)
    order = np.argsort(mesh.vertices[mesh.faces].mean(axis=1)[:, 2], kind="stable")
    faces = mesh.faces[np.sort(order[lost:])]
    return Mesh(mesh.vertices + np.array([x_mm, 0.0, 0.0]), faces[:, ::-1] if inwards else faces)


def together(*meshes: Mesh) -> Mesh:
    starts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    faces = [mesh.faces + start for mesh, start in zip(meshes, starts, strict=False)]
    return Mesh(np.concatenate([mesh.vertices for mesh in meshes]), np.concatenate(faces))


def within(*meshes: Mesh) -> tuple[Mesh, np.ndarray]:
    both = together(*meshes)
    return both, within_others(both.vertices, both.faces, topology.edges(both.faces))


@pytest.mark.parametrize(("first", "second"), [(6, 0), (0, 6), (6, 6)])
@pytest.mark.parametrize("apart_mm", [12.0, 6.0])
def test_the_caps_of_two_balls_within_each_other(first: int, second: int, apart_mm: float) -> None:
    """Of each ball the cap of height r - d / 2 lies within the other."""
    both, inside = within(ball(0.0, lost=first), ball(apart_mm, lost=second))
    corners = both.vertices[both.faces]
    to_other = np.where(np.arange(len(both.faces)) < 20 * 4**4 - first, apart_mm, 0.0)
    depth = RADIUS_MM - np.linalg.norm(corners - to_other[:, None, None] * [1.0, 0.0, 0.0], axis=2)
    limit_mm = MIN_DEPTH_SHARE * both.diagonal_mm
    assert inside[(depth > limit_mm + 0.05).all(axis=1)].all()  # 0.05: the chords of a ball of triangles
    assert not inside[(depth < limit_mm).any(axis=1)].any()
    caps_mm2 = 2 * 2 * np.pi * RADIUS_MM * (RADIUS_MM - apart_mm / 2)
    assert both.face_areas_mm2()[inside].sum() == pytest.approx(caps_mm2, rel=0.12)


def test_a_body_wholly_within_one_with_a_hole_is_left_out() -> None:
    _, inside = within(ball(0.0, lost=6), ball(0.0, 4.0))
    assert inside.tolist() == [False] * (5120 - 6) + [True] * 5120


@pytest.mark.parametrize(
    "inner",
    [
        pytest.param(ball(0.0, 4.0, inwards=True), id="a cavity"),
        pytest.param(ball(0.0, 4.0, lost=2000), id="a bowl, which may be the wall of a cavity"),
        pytest.param(ball(30.0, 4.0), id="apart"),
    ],
)
def test_what_is_no_body_within_stays(inner: Mesh) -> None:
    _, inside = within(ball(0.0, lost=6), inner)
    assert not inside.any()


def test_what_stands_in_a_cup_is_seen() -> None:
    cup = ball(0.0, lost=400)
    assert 0.05 < 400 / 5120 and MAX_HOLE_SHARE < 0.05
    _, inside = within(cup, ball(0.0, 4.0))
    assert not inside.any()
    _, inside = within(
        ball(0.0, lost=6, inwards=True), ball(0.0, 4.0)
    )  # nothing is within what looks inwards
    assert not inside.any()


def test_two_closed_bodies_are_for_the_union() -> None:
    _, inside = within(ball(0.0), ball(12.0), ball(60.0, lost=6))
    assert not inside.any()


def test_a_design_says_it_and_a_scan_keeps_what_was_seen() -> None:
    both = together(ball(0.0, lost=6), ball(0.0, 4.0))
    found = clean(both, "design", CleanSettings())
    assert found.report["faces_within_others"] == 5120 == len(both.faces) - len(found.mesh.faces)
    assert found.report["area_within_others_mm2"] == pytest.approx(4 * np.pi * 16, rel=0.01)
    assert len(clean(both, "scan", CleanSettings()).mesh.faces) == len(both.faces)
    assert len(clean(both, "design", CleanSettings(unite_bodies=False)).mesh.faces) == len(both.faces)
