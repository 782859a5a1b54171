"""Where a design repeats itself: in closed form on a row of equal boxes."""

import numpy as np
import pytest

from pipeline.core.mesh import Mesh
from pipeline.kernels import sampling
from pipeline.kernels.surface import Surface
from pipeline.verification.repeats import repetition_mm
from tests.support import shapes

PITCH_MM, REACH_MM = 30.0, 4.0


def row_of_boxes() -> tuple[Mesh, Mesh]:
    """The first of three boxes of 10 mm, 30 mm from one to the next, and all of them."""
    box = shapes.box((10.0, 10.0, 10.0))
    vertices = [box.vertices + np.array([PITCH_MM * i, 0.0, 0.0]) for i in range(3)]
    faces = [box.faces + len(box.vertices) * i for i in range(3)]
    return box, Mesh(np.concatenate(vertices), np.concatenate(faces))


def moved_along_x(by_mm: float) -> np.ndarray:
    motion = np.eye(4)
    motion[0, 3] = by_mm
    return motion


@pytest.mark.parametrize(
    ("by_mm", "off_mm"),
    [(0.0, 0.0), (PITCH_MM, 0.0), (2 * PITCH_MM, 0.0), (3 * PITCH_MM, REACH_MM), (PITCH_MM / 2, REACH_MM)],
)
def test_a_step_of_the_pitch_is_a_repetition_and_another_is_none(by_mm: float, off_mm: float) -> None:
    box, row = row_of_boxes()
    shown = sampling.on_surface(box, 500, 0).points
    assert repetition_mm(Surface(row), shown, moved_along_x(by_mm), REACH_MM) == pytest.approx(
        off_mm, abs=1e-9
    )


def test_a_small_step_is_off_by_what_two_of_six_faces_move() -> None:
    """The four faces along the motion stay on the box, but for the strip that leaves it."""
    box, row = row_of_boxes()
    shown = sampling.on_surface(box, 20_000, 0).points
    off_mm = repetition_mm(Surface(row), shown, moved_along_x(0.1), REACH_MM)
    assert off_mm == pytest.approx(0.1 * np.sqrt(2 / 6), rel=0.03)


def test_a_scan_that_shows_nothing_of_the_design_repeats_nothing() -> None:
    _, row = row_of_boxes()
    assert repetition_mm(Surface(row), np.zeros((0, 3)), np.eye(4), REACH_MM) == float("inf")
