"""The group of motions under which a design is its own image, by formula."""

import numpy as np
import pytest

from pipeline.analysis.mesh_analysis import Scales
from pipeline.analysis.symmetry_group import SymmetryGroup
from pipeline.core.mesh import Mesh
from pipeline.kernels import rigid
from pipeline.search.hypotheses import box_corners
from pipeline.search.schedule import SYMMETRY
from tests.support import shapes
from tests.support.designs import design_of
from tests.support.settings import COARSE as QUICK
from tests.support.shapes import cross


def test_a_small_motion_is_no_symmetry() -> None:
    """A pose 1.5 % of the diagonal beside the best is its rival, though an ICP of the design would slide
    back.
    """
    found = symmetries(cross(4))
    beside = np.eye(4)
    beside[0, 3] = 0.015 * found._diagonal_mm
    assert not found.contains(beside) and not found.contains(np.eye(4))


def test_near_images_of_a_gear_are_its_other_teeth() -> None:
    """36 teeth, one with a key: 35 turns, and 36 turned over, leave next to nothing; none is a symmetry."""
    found = symmetries(shapes.gear(36))
    assert found.elements == ()
    angles = {round(rigid.angle_deg(T)) for T in found.approximate if abs(T[2, 2] - 1) < 0.01}
    assert {10 * k for k in range(1, 19)} <= angles
    assert sum(abs(T[2, 2] - 1) < 0.01 for T in found.approximate) == 35
    assert sum(abs(T[2, 2] + 1) < 0.01 for T in found.approximate) == 36


@pytest.mark.parametrize(
    "part", [cross(6), shapes.box((20.0, 20.0, 0.4), 3), shapes.beads()], ids=["cross", "box", "beads"]
)
def test_near_images_are_told_apart_and_none_is_exact(part: Mesh) -> None:
    found = symmetries(part)
    assert len(found.approximate) <= SYMMETRY.max_approximate
    every = [np.eye(4), *found.elements, *found.approximate]
    corners_mm = box_corners(part)
    for k, T in enumerate(found.approximate, start=1 + len(found.elements)):
        apart = [rigid.rms_displacement(T, each, corners_mm) for each in every[:k]]
        assert min(apart) > 0.009 * part.diagonal_mm


def test_a_body_of_revolution_has_no_rival_beside_its_turns() -> None:
    """A turn of less than 2 % of the diagonal is a symmetry too, where the surface does not slide back: by
    one facet.
    """
    found = symmetries(shapes.beads())
    angle = 2 * np.pi / 40
    turn = np.eye(4)
    turn[1:3, 1:3] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    assert found.contains(turn)


def symmetries(mesh: Mesh) -> SymmetryGroup:
    return design_of(mesh, QUICK).symmetry


@pytest.mark.parametrize("arms", [3, 4])
def test_equal_lobes_make_a_cyclic_group_wherever_the_part_lies(arms: int) -> None:
    part = cross(arms)
    T = shapes.motion(7)
    found = symmetries(part.moved(T))
    assert len(found.elements) == arms - 1
    turns = sorted(rigid.angle_deg(each) for each in found.elements)
    np.testing.assert_allclose(turns, sorted(min(k, arms - k) * 360 / arms for k in range(1, arms)), atol=0.1)
    for each in found.elements:  # about the part's own axis: points on it stay
        on_axis = rigid.transformed(T, np.array([[0.0, 0, -3], [0, 0, 3]]))
        np.testing.assert_allclose(rigid.transformed(each, on_axis), on_axis, atol=0.05)


def test_the_group_is_closed() -> None:
    found = symmetries(cross(4))
    assert len(found.elements) == 3
    for first in found.elements:
        for second in found.elements:
            product = first @ second
            assert found.same(product, np.eye(4)) or any(found.same(product, each) for each in found.elements)


def test_a_lobe_that_is_higher_ends_the_symmetry() -> None:
    assert symmetries(cross(4, lift_mm=1.0)).elements == ()


def test_a_brick_has_its_four_rotations_and_no_reflection() -> None:
    found = symmetries(shapes.box((10.0, 20.0, 30.0), 3))
    assert len(found.elements) == 3
    assert all(np.linalg.det(each[:3, :3]) > 0 for each in found.elements)
    assert [round(rigid.angle_deg(each)) for each in found.elements] == [180, 180, 180]


@pytest.mark.parametrize("sides", [3, pytest.param(5, marks=pytest.mark.nightly), 6])
def test_a_prism_turns_over_too(sides: int) -> None:
    """n turns about its axis, and n half turns about axes across it, at angles that no principal axis
    tells.
    """
    angle = 2 * np.pi * np.arange(sides) / sides + 0.3
    ring = np.stack([10 * np.cos(angle), 10 * np.sin(angle)], axis=1)
    bottom, top = (np.column_stack([ring, np.full(sides, z)]) for z in (-6.0, 6.0))
    vertices = np.concatenate([bottom, top, [[0, 0, -6.0], [0, 0, 6.0]]])
    k, after = np.arange(sides), np.roll(np.arange(sides), -1)
    walls = np.concatenate(
        [np.stack([k, after, after + sides], 1), np.stack([k, after + sides, k + sides], 1)]
    )
    caps = np.concatenate(
        [
            np.stack([after, k, 0 * k + 2 * sides], 1),
            np.stack([k + sides, after + sides, 0 * k + 2 * sides + 1], 1),
        ]
    )
    found = symmetries(Mesh(vertices, np.concatenate([walls, caps])).moved(shapes.motion(2)))
    assert len(found.elements) == 2 * sides - 1
    half_turns = [each for each in found.elements if rigid.angle_deg(each) > 179.9]
    assert len(half_turns) == sides + (sides % 2 == 0)


def test_what_is_known_of_a_design_says_its_scales() -> None:
    part = shapes.bumpy_blob(4)
    design = design_of(part, QUICK)
    assert design.scales == Scales.of(part, QUICK)
    assert design.diagonal_mm == part.diagonal_mm
    assert design.symmetry.elements == ()
