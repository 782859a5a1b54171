"""What a design can hide from a scanner: closed forms on a ball in a shell, a plane behind a plane."""

import numpy as np
import pytest

from pipeline.core.mesh import Mesh
from pipeline.kernels import rigid, sampling
from pipeline.kernels.surface import Surface
from pipeline.kernels.visibility import ViewModel
from tests.support import shapes


def joined(*meshes: Mesh) -> Mesh:
    starts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    faces = [mesh.faces + start for mesh, start in zip(meshes, starts, strict=False)]
    return Mesh(np.concatenate([mesh.vertices for mesh in meshes]), np.concatenate(faces))


def views(mesh: Mesh, count: int = 400) -> ViewModel:
    samples = sampling.on_surface(mesh, count, 0)
    return ViewModel.of(samples.points, samples.normals)


def test_a_ball_is_seen_from_all_around_and_not_at_all_inside_a_shell() -> None:
    ball, shell = shapes.icosphere(5.0, 3), shapes.icosphere(10.0, 3)
    assert views(ball).occlusion_ratio(np.eye(4), Surface(ball), 0.1) == 0.0
    assert views(ball).occlusion_ratio(np.eye(4), Surface(joined(ball, shell)), 0.1) == 1.0


def test_the_share_of_the_area_that_is_buried_is_what_is_hidden() -> None:
    """The caps of a ball above the height h of a box that covers it: (1 - h / r) / 2 of the area stays
    outside.
    """
    ball, box = shapes.icosphere(10.0, 4), shapes.box((60.0, 60.0, 60.0), 2)
    for height in (-5.0, 0.0, 5.0):
        buried_below = box.moved(rigid.compose(np.eye(3), np.array([0.0, 0.0, height - 30.0])))
        placed = Mesh(
            buried_below.vertices
            - [buried_below.vertices[:, 0].mean(), buried_below.vertices[:, 1].mean(), 0],
            box.faces,
        )
        top = placed.vertices[:, 2].max()
        expected = (1 + np.clip(top / 10.0, -1, 1)) / 2
        found = views(ball, 2000).occlusion_ratio(np.eye(4), Surface(placed), 0.01)
        assert found == pytest.approx(expected, abs=0.05)


def test_one_view_is_stricter_than_a_walk_around() -> None:
    """A plane under a shelf as wide as it is seen past the edges, but not by a camera straight above."""
    plane = shapes.grid_plane(21, 21)
    shelf = plane.moved(rigid.compose(np.eye(3), np.array([0.0, 0.0, 20.0])))
    one = views(plane)
    assert one.directions.strides[0] == 0  # the same few directions for all points
    middle = np.abs(one.points[:, :2] - one.points[:, :2].mean(axis=0)).max(axis=1) < 2
    seen = ViewModel(one.points[middle], one.directions[middle])
    assert seen.occlusion_ratio(np.eye(4), Surface(joined(plane, shelf)), 0.05) == 1.0
    assert seen.occlusion_ratio(np.eye(4), Surface(plane), 0.05) == 0.0


def test_moving_scan_and_design_together_changes_little() -> None:
    part, T = joined(shapes.icosphere(5.0, 3), shapes.box((8.0, 8.0, 8.0), 2)), shapes.motion(3)
    seen = views(part)
    here = seen.occlusion_ratio(np.eye(4), Surface(part), 0.05)
    there = seen.occlusion_ratio(T, Surface(part.moved(T)), 0.05)
    assert here > 0.1
    assert there == pytest.approx(here, abs=0.02)
