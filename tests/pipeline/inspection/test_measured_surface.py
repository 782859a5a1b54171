"""A wall that was not scanned has no deviation, however near the edge of the scan it is."""

import numpy as np

from pipeline.core.mesh import Mesh
from pipeline.inspection.measured_surface import lies_beside
from pipeline.kernels.surface import Surface
from pipeline.stages.deviation import signed_to_scan
from pipeline.stages.registration import evaluate_fit
from tests.support import shapes

BLOCK = shapes.box((20.0, 20.0, 10.0))
LOW, HIGH = BLOCK.vertices.min(axis=0), BLOCK.vertices.max(axis=0)


def top(raised_mm: float) -> Mesh:
    """A scan of the upper face alone, 0.01 mm larger than it to each side."""
    grid = shapes.grid_plane(41, 41, step_mm=0.5)
    centre = (LOW + HIGH) / 2
    vertices = (grid.vertices - grid.vertices.mean(axis=0)) * 1.001 + centre
    vertices[:, 2] = HIGH[2] + raised_mm
    return Mesh(vertices, grid.faces)


def test_a_wall_below_the_edge_of_the_scan_was_not_seen() -> None:
    centre, scan = (LOW + HIGH) / 2, top(0.3)
    places = np.array([[HIGH[0], centre[1], HIGH[2] - 1.5], [centre[0], centre[1], HIGH[2]]])
    normals = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    fit = evaluate_fit(scan, scan.weights(), Surface(BLOCK), np.eye(4), 1.0)
    signed_mm, ends_there, way_mm = signed_to_scan(places, scan, Surface(scan), fit)
    np.testing.assert_allclose(way_mm, [[0, 0, 1.8], [0, 0, 0.3]], atol=1e-9)
    np.testing.assert_allclose(signed_mm[1], 0.3)
    assert not ends_there.any()  # the scan goes on above both
    assert lies_beside(way_mm, normals, 0.01).tolist() == [True, False]


def test_the_corner_of_a_box_with_one_face_moved_is_shown() -> None:
    normal = np.ones((1, 3)) / np.sqrt(3.0)
    assert not lies_beside(np.array([[0.2, 0.0, 0.0]]), normal, 0.01).any()


def test_a_place_on_the_scan_is_shown_whatever_way_rounding_leads() -> None:
    assert not lies_beside(np.array([[1e-12, 0.0, 0.0], [0.0, 0.0, 0.0]]), np.eye(3)[1:], 0.01).any()
