"""What a design can hide from a scanner: closed forms on a ball in a shell, a plane behind a plane, and
a ball between two scanners whose places are known.
"""

import numpy as np
import pytest

from pipeline.core.mesh import Mesh
from pipeline.kernels import rigid, sampling
from pipeline.kernels.surface import Surface
from pipeline.kernels.visibility import MIN_GRAZING_SINE, LinesOfSight, ViewModel
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


RADIUS_MM, DISTANCE_MM = 10.0, 40.0
BALL = shapes.icosphere(RADIUS_MM, 5)


def behind(along: np.ndarray) -> np.ndarray:
    """(k,) sine of the angle between the line of sight and the surface, at points of the ball by their cosine
    to the direction of the scanner; negative on the far side.
    """
    length = np.sqrt(RADIUS_MM**2 + DISTANCE_MM**2 - 2 * RADIUS_MM * DISTANCE_MM * along)
    return (DISTANCE_MM * along - RADIUS_MM) / length


def test_a_scanner_beside_a_ball_does_not_see_its_far_side() -> None:
    points = sampling.on_surface(BALL, 4000, 0).points
    scanner = np.array([0.0, 0.0, DISTANCE_MM])
    sight = LinesOfSight(points, np.broadcast_to(scanner, points.shape))
    along = np.linspace(-1.0, 1.0, 100_001)  # the area of a ball is uniform in it
    expected = float((behind(along) < -MIN_GRAZING_SINE).mean())
    assert 0.4 < expected < 0.6
    assert sight.occlusion_ratio(np.eye(4), Surface(BALL), 0.1) == pytest.approx(expected, abs=0.02)


def test_of_two_scanners_each_sees_its_own_side_only() -> None:
    points = sampling.on_surface(BALL, 4000, 0).points
    side = np.sign(points[:, 2])
    scanner = np.stack([0 * side, 0 * side, DISTANCE_MM * side], axis=1)
    T, along = shapes.motion(5), np.linspace(0.0, 1.0, 100_001)
    for given, cosine in ((scanner, along), (-scanner, -along)):
        expected = float((behind(cosine) < -MIN_GRAZING_SINE).mean())
        found = LinesOfSight(points, given).occlusion_ratio(T, Surface(BALL.moved(T)), 0.1)
        assert found == pytest.approx(expected, abs=0.02)
    assert expected > 0.9  # of the far side


def test_what_stands_behind_the_scanner_hides_nothing_and_what_stands_before_it_does() -> None:
    plane = shapes.grid_plane(21, 21)
    wall = plane.moved(rigid.compose(np.eye(3), np.array([0.0, 0.0, 20.0])))
    inner = plane.vertices[np.abs(plane.vertices[:, :2] - plane.vertices[:, :2].mean(axis=0)).max(axis=1) < 5]
    both = Surface(joined(plane, wall))
    for height, hidden in ((15.0, 0.0), (25.0, 1.0)):
        scanner = np.broadcast_to([*plane.vertices.mean(axis=0)[:2], height], inner.shape)
        assert LinesOfSight(inner, scanner).occlusion_ratio(np.eye(4), both, 0.05) == hidden
