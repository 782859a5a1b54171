"""Pictures show what is there: the right place, the right colour, nothing of what is hidden."""

import io

import numpy as np
import open3d as o3d
import pytest
from PIL import Image

from pipeline.core.mesh import Mesh
from pipeline.kernels.native import core
from pipeline.report.render import AMBIENT, BACK_COLOUR, DOT_COLOUR, MARGIN, Framing, View, picture, rendered
from tests.support.shapes import box, bumpy_blob, icosphere, motion

TOP = View.along("top", np.array([0.0, 0, 1]), np.array([0.0, 1, 0]))


def pixels(data: bytes) -> np.ndarray:
    return np.asarray(Image.open(io.BytesIO(data)), dtype=np.float64) / 255


def test_a_sphere_is_a_disc_of_its_size_lit_from_the_eye() -> None:
    ball = icosphere(10.0, 4)
    image = pixels(picture(ball, np.tile([1.0, 0, 0], (len(ball.vertices), 1)), TOP, ball.vertices, 200, 100))
    covered = (image < 0.999).any(axis=2)
    radius_px = 100 / (2 * MARGIN)
    assert covered.sum() == pytest.approx(np.pi * radius_px**2, rel=0.02)
    assert image[50, 100] == pytest.approx([1, 0, 0], abs=0.02)
    across = image[50, 100:, 0][covered[50, 100:]]
    x = (np.arange(len(across)) + 0.5) / radius_px
    lit = AMBIENT + (1 - AMBIENT) * np.sqrt(np.clip(1 - x**2, 0, 1))
    assert np.abs(across - lit)[:-2].max() < 0.04  # Lambert's law, a lamp at the eye


def test_colours_are_where_the_vertices_are() -> None:
    cube = box((2.0, 2.0, 2.0), levels=3)
    colours = (cube.vertices - cube.vertices.min(axis=0)) / 2
    image = pixels(picture(cube, colours, TOP, cube.vertices, 106, 106))
    assert image[53, 53] == pytest.approx([0.5, 0.5, 1.0], abs=0.02)
    assert image[8, 98] == pytest.approx([0.95, 0.95, 1.0], abs=0.05)  # right is +x, up is +y
    assert image[98, 8] == pytest.approx([0.05, 0.05, 1.0], abs=0.05)


def test_a_mark_is_a_dot_and_a_hidden_one_is_not() -> None:
    ball = icosphere(10.0, 4)
    white = np.ones((len(ball.vertices), 3))
    for z, dots in ((10.0, True), (-10.0, False)):
        image = pixels(picture(ball, white, TOP, ball.vertices, 100, 100, landmarks_mm=np.array([[0, 0, z]])))
        assert bool(np.abs(image[50, 50] - DOT_COLOUR).max() < 0.05) == dots


def test_a_cloud_is_drawn_nearest_last() -> None:
    points = np.array([[0.0, 0, 0], [0, 0, 1], [5, 5, 0], [-5, -5, 0]])
    cloud = Mesh(points, np.zeros((0, 3), dtype=np.int32))
    colours = np.array([[1.0, 0, 0], [0, 1, 0], [0, 0, 1], [0, 0, 1]])
    image = pixels(picture(cloud, colours, TOP, points, 101, 101))
    assert image[50, 50] == pytest.approx([0, 1, 0])


def test_the_back_of_an_open_surface_is_not_taken_for_its_front() -> None:
    square = Mesh(np.array([[0.0, 0, 0], [4, 0, 0], [4, 4, 0], [0, 4, 0]]), np.array([[0, 1, 2], [0, 2, 3]]))
    white, below = np.ones((4, 3)), View.along("below", np.array([0.0, 0, -1]), np.array([0.0, 1, 0]))
    for view, fronts, is_back in ((TOP, 1, False), (below, 1, True), (TOP, -1, True), (below, 0, False)):
        framing = Framing.of(view, square.vertices, 40, 40)
        middle = rendered(square, white, framing, fronts=fronts).image[20, 20]
        assert bool(middle.max() < 0.6) == is_back and middle == pytest.approx(
            0.25 + 0.75 * BACK_COLOUR if is_back else np.ones(3), abs=0.02
        )


def test_a_surface_hides_the_points_behind_it() -> None:
    ball = icosphere(10.0, 4)
    cloud = Mesh(np.array([[0.0, 0, 10], [3, 0, -9]]), np.zeros((0, 3), dtype=np.int32))
    colours = np.array([[1.0, 0, 0], [0, 0, 1]])
    image = rendered(cloud, colours, Framing.of(TOP, ball.vertices, 101, 101), under=ball).image
    assert image[50, 50] == pytest.approx([1, 0, 0]) and not (image[..., 2] > image[..., 0] + 0.5).any()


def test_the_same_bytes_each_time() -> None:
    ball = icosphere(10.0, 4)
    colours = np.abs(ball.vertices) / 10
    assert len({picture(ball, colours, TOP, ball.vertices, 80, 60) for _ in range(3)}) == 1


def test_every_sample_shows_what_a_ray_caster_sees() -> None:
    """Depth and background, by Open3D's rays; the colours are the depth, so interpolation is tested too."""
    blob = bumpy_blob(3).moved(motion(5))
    low, high = blob.vertices.min(axis=0), blob.vertices.max(axis=0)
    width, height, step = 90, 70, float((high - low)[:2].max()) / 60
    left, top = float(low[0]) - 5 * step, float(high[1]) + 3 * step
    colours = np.repeat(blob.vertices[:, 2:], 3, axis=1)
    image, depth = core.picture(
        blob.vertices, blob.faces, colours, left, top, step, width, height, 1.0, 7.0, 2
    )
    x, y = np.meshgrid(left + step * np.arange(width), top - step * np.arange(height))
    start = np.stack([x, y, np.full_like(x, high[2] + 1)], axis=-1)
    rays = np.concatenate([start, np.broadcast_to([0.0, 0, -1], start.shape)], axis=-1).astype(np.float32)
    scene = o3d.t.geometry.RaycastingScene()
    scene.add_triangles(
        o3d.core.Tensor(blob.vertices.astype(np.float32)), o3d.core.Tensor(blob.faces.astype(np.uint32))
    )
    seen = high[2] + 1 - scene.cast_rays(o3d.core.Tensor(rays))["t_hit"].numpy()
    assert np.mean(np.isfinite(seen) == np.isfinite(depth)) > 0.999  # but for rays along the outline
    both = np.isfinite(seen) & np.isfinite(depth)
    np.testing.assert_allclose(depth[both], seen[both], atol=1e-3)
    np.testing.assert_allclose(image[both], np.repeat(depth[both][:, None], 3, axis=1), rtol=1e-5, atol=1e-4)
    assert (image[~np.isfinite(depth)] == 7.0).all()


def test_no_sample_falls_between_two_triangles() -> None:
    """Corners and edges lie exactly on samples."""
    square = box((8.0, 8.0, 1.0), levels=3)
    low = square.vertices.min(axis=0)
    _, depth = core.picture(
        square.vertices,
        square.faces,
        np.ones_like(square.vertices),
        low[0],
        low[1] + 8.0,
        0.25,
        33,
        33,
        1.0,
        0.0,
        1,
    )
    assert np.isfinite(depth).all()


def test_threads_do_not_change_one_bit_of_a_picture() -> None:
    blob = bumpy_blob(3)
    arguments = (blob.vertices, blob.faces, np.abs(blob.vertices), -20.0, 20.0, 0.1, 400, 400, 0.3, 1.0)
    (one, depth), (four, same) = core.picture(*arguments, 1), core.picture(*arguments, 4)
    np.testing.assert_array_equal(one, four)
    np.testing.assert_array_equal(depth, same)
