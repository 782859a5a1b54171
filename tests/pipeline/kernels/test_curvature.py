"""Discrete curvature against closed forms."""

import numpy as np
import pytest

from pipeline.core.mesh import Mesh
from pipeline.kernels import curvature
from tests.support import shapes


@pytest.mark.parametrize("radius_mm", [0.5, 7.0])
def test_sphere_has_mean_curvature_one_over_r_and_gaussian_one_over_r_squared(radius_mm: float) -> None:
    sphere = shapes.icosphere(radius_mm, 4)
    areas = sphere.vertex_areas_mm2()
    inwards = curvature.integrated_laplacian(sphere) / areas[:, None]
    mean = -0.5 * np.einsum("nd,nd->n", inwards, sphere.vertex_normals())
    gaussian = curvature.angle_defect(sphere, border_correction=True) / areas
    assert np.median(mean) * radius_mm == pytest.approx(1.0, rel=0.01)
    assert np.median(gaussian) * radius_mm**2 == pytest.approx(1.0, rel=0.01)


def test_plane_has_none_inside_and_none_on_its_corrected_straight_border() -> None:
    plane = shapes.grid_plane()
    inner = (plane.vertices[:, :2] > 0).all(axis=1) & (plane.vertices[:, :2] < [11, 8]).all(axis=1)
    np.testing.assert_allclose(curvature.integrated_laplacian(plane)[inner], 0, atol=1e-12)
    defect = curvature.angle_defect(plane, border_correction=True)
    np.testing.assert_allclose(np.sort(defect)[:-4], 0, atol=1e-12)
    np.testing.assert_allclose(
        np.sort(defect)[-4:], np.pi / 2, atol=1e-12
    )  # the four corners turn by 90 degrees
    uncorrected = curvature.angle_defect(plane, border_correction=False)
    assert np.median(uncorrected[~inner]) == pytest.approx(np.pi)


@pytest.mark.parametrize(
    ("mesh", "euler"),
    [
        (shapes.icosphere(2.0, 2), 2),
        (shapes.torus(around=30, across=15), 0),
        (shapes.box(), 2),
        (shapes.grid_plane(), 1),
    ],
    ids=["sphere", "torus", "box", "disc"],
)
def test_gauss_bonnet(mesh: Mesh, euler: int) -> None:
    total = curvature.angle_defect(mesh, border_correction=True).sum()
    assert total == pytest.approx(2 * np.pi * euler, abs=1e-9)


def test_laplacian_is_symmetric_and_blind_to_constants_and_linear_functions_in_the_plane() -> None:
    blob = shapes.bumpy_blob(3)
    L = curvature.cotangent_laplacian(blob)
    assert abs(L - L.T).max() < 1e-12
    np.testing.assert_allclose(L @ np.ones(len(blob.vertices)), 0, atol=1e-9)


def test_averaging_keeps_constants_and_is_a_weighted_mean() -> None:
    from pipeline.kernels.geodesics import GeodesicSolver

    blob = shapes.bumpy_blob(3)
    near = GeodesicSolver(blob.vertices, blob.faces).within(6.0)
    A = curvature.averaging(blob, near, 6.0)
    np.testing.assert_allclose(np.asarray(A.sum(axis=1)).ravel(), 1.0, rtol=1e-12)
    assert A.data.min() > 0
