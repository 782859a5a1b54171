"""Cells cover the surface once, keep a constant, part the two faces of a thin wall, and average noise,
whatever the density of the mesh.
"""

import numpy as np

from pipeline.core.mesh import Mesh
from pipeline.kernels import topology
from pipeline.kernels.surface_cells import SurfaceCells
from tests.support import shapes
from tests.support.scanners.surroundings import joined

BALL = shapes.icosphere(10.0, 5)


def cells_of(mesh: Mesh, voxel_mm: float) -> SurfaceCells:
    ends = topology.edges(mesh.faces).ends
    return SurfaceCells.of(mesh.vertices, ends, mesh.vertex_areas_mm2(), voxel_mm)


def test_the_cells_cover_the_surface_once_and_each_is_within_its_voxel() -> None:
    cells = cells_of(BALL, 2.0)
    np.testing.assert_allclose(cells.weight.sum(), BALL.face_areas_mm2().sum(), rtol=1e-12)
    away = np.abs(BALL.vertices - cells.centre_mm[cells.of_vertex])
    assert away.max() < 2.0
    assert (cells.adjacency != cells.adjacency.T).nnz == 0
    assert set(np.unique(cells.adjacency.data)) == {1.0}


def test_a_constant_stays_and_noise_falls_with_the_points_in_a_cell() -> None:
    rng = np.random.default_rng(0)
    spread = []
    for subdivisions in (4, 5, 6):
        ball = shapes.icosphere(10.0, subdivisions)
        cells, areas = cells_of(ball, 3.0), ball.vertex_areas_mm2()
        np.testing.assert_allclose(cells.means(np.full(len(areas), 0.7), areas), 0.7)
        large = cells.weight > 4.5  # half a voxel: corners of voxels cut off small cells
        spread.append(cells.means(rng.normal(size=len(areas)), areas)[large].std())
    # four times the points a step
    np.testing.assert_allclose(np.divide(spread[:-1], spread[1:]), 2.0, rtol=0.3)


def test_the_two_faces_of_a_thin_wall_are_two_cells() -> None:
    inner = Mesh(BALL.vertices * 0.97, BALL.faces[:, ::-1])
    wall = joined([BALL, inner])
    cells = cells_of(wall, 2.0)
    assert not set(cells.of_vertex[: len(BALL.vertices)]) & set(cells.of_vertex[len(BALL.vertices) :])


def test_a_vertex_without_weight_does_not_count() -> None:
    weights = BALL.vertex_areas_mm2() * (BALL.vertices[:, 2] > 0)
    cells = cells_of(BALL, 2.0)
    mean = cells.means(np.where(BALL.vertices[:, 2] > 0, 0.5, 9.0), weights)
    assert set(mean) == {0.0, 0.5}
