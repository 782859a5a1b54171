"""Decimation: the surface stays, its topology stays, and the same input gives the same bytes."""

import numpy as np
import pytest

from pipeline.core.mesh import Mesh
from pipeline.kernels import remesh, topology
from pipeline.kernels.surface import Surface
from tests.support import shapes


@pytest.mark.parametrize(
    "part", [shapes.bumpy_blob(6), shapes.torus(20.0, 6.0, 300, 150)], ids=["blob", "torus"]
)
def test_about_a_tenth_of_the_triangles_lies_on_the_same_surface(part: Mesh) -> None:
    few = remesh.decimated(part, len(part.faces) // 10)
    assert 0.98 * len(part.faces) / 10 <= len(few.faces) <= 2.2 * len(part.faces) / 10
    edges = topology.edges(few.faces)
    assert (edges.count == 2).all()
    assert topology.is_coherent(few.faces)
    euler = len(few.vertices) - len(edges.ends) + len(few.faces)
    assert euler == len(part.vertices) - len(topology.edges(part.faces).ends) + len(part.faces)
    assert Surface(part).closest(few.vertices).distance.max() < 0.002 * part.diagonal_mm
    assert Surface(few).closest(part.vertices).distance.max() < 0.002 * part.diagonal_mm


def test_a_scan_as_rough_as_its_triangles_comes_down_too() -> None:
    """Noise of a third of an edge: the careful way stops at several times what was asked."""
    part = shapes.bumpy_blob(6)
    noise = np.random.default_rng(0).normal(0, 0.1, part.vertices.shape)
    rough = Mesh(part.vertices + noise, part.faces)
    few = remesh.decimated(rough, 8000)
    assert len(few.faces) <= 8100 < 16_000 < len(remesh._simplified(rough, 8000, remesh.CAREFUL).faces)
    assert topology.edges(few.faces).count.max() == 2
    distance = Surface(part).closest(few.vertices).distance
    assert np.sqrt((distance**2).mean()) < 0.2


def test_roughness_of_a_plane_and_of_a_cube() -> None:
    assert remesh.roughness_deg(shapes.grid_plane()) == pytest.approx(0.0, abs=1e-5)
    assert remesh.roughness_deg(shapes.box()) > 20.0  # every corner is one of the cube's


def test_an_open_border_stays_but_for_its_corners() -> None:
    plane = shapes.grid_plane(101, 76)
    few = remesh.decimated(plane, 1000)
    np.testing.assert_allclose(np.ptp(few.vertices, axis=0), np.ptp(plane.vertices, axis=0), atol=1e-9)
    assert few.face_areas_mm2().sum() == pytest.approx(plane.face_areas_mm2().sum(), rel=0.005)


def test_the_same_input_gives_the_same_bytes() -> None:
    part = shapes.bumpy_blob(5)
    first, second = remesh.decimated(part, 3000), remesh.decimated(part, 3000)
    assert first.vertices.tobytes() == second.vertices.tobytes()
    assert first.faces.tobytes() == second.faces.tobytes()


def test_coincident_ends_of_edges_become_one_vertex() -> None:
    ball = shapes.icosphere(10.0, 3)
    n = len(ball.vertices)
    # vertex 0 becomes two, a hair apart, and its triangles are shared out between them
    around = np.flatnonzero((ball.faces == 0).any(axis=1))
    faces = ball.faces.copy()
    faces[around[:3]] = np.where(faces[around[:3]] == 0, n, faces[around[:3]])
    torn = Mesh(
        np.vstack([ball.vertices, ball.vertices[:1] + 1e-12]),
        np.vstack([faces, [[0, n, faces[around[3]][1]]]]),
    )
    whole = remesh.without_tiny_edges(torn, 1e-3)
    np.testing.assert_array_equal(whole.vertices, ball.vertices)
    np.testing.assert_array_equal(whole.faces, ball.faces)
    assert remesh.without_tiny_edges(ball, 1e-3) is ball
