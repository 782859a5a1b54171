"""Features are the curvatures of the surface, whatever triangles it comes in."""

from collections.abc import Callable

import numpy as np
import pytest

from pipeline.core.mesh import FloatArray, Mesh
from pipeline.core.settings import FeaturesSettings
from pipeline.stages.features import features
from tests.support import shapes

Project = Callable[[FloatArray], FloatArray]


def irregular(mesh: Mesh, project: Project, shift_mm: float) -> Mesh:
    """The same faces over points shifted at random and put back on the surface."""
    shift = np.random.default_rng(0).normal(0, shift_mm, mesh.vertices.shape)
    return Mesh(project(mesh.vertices + shift), mesh.faces)


def on_sphere(points: FloatArray) -> FloatArray:
    return 10 * points / np.linalg.norm(points, axis=1, keepdims=True)


def on_cylinder(points: FloatArray) -> FloatArray:
    return points * np.column_stack([2 / np.hypot(points[:, 0], points[:, 1])] * 2 + [np.ones(len(points))])


def on_torus(points: FloatArray) -> FloatArray:
    ring = points * [1, 1, 0]
    ring = 5 * ring / np.linalg.norm(ring, axis=1, keepdims=True)
    return ring + 2 * (points - ring) / np.linalg.norm(points - ring, axis=1, keepdims=True)


@pytest.mark.parametrize("shift_mm", [0.0, 0.1], ids=["even", "irregular"])
def test_sphere(shift_mm: float) -> None:
    """Radius 10: m = 1/10, G = 1/100, |l| = 2/10; a cap of radius r has 1 / (1 - (r/2R)^2 ...) times its
    projection.
    """
    a, m, gaussian, *laplacian = features(
        irregular(shapes.icosphere(10.0, 4), on_sphere, shift_mm), 2.0, FeaturesSettings()
    ).values.T
    np.testing.assert_allclose(m, 0.1, rtol=0.02)
    np.testing.assert_allclose(gaussian, 0.01, rtol=0.02)
    np.testing.assert_allclose(np.linalg.norm(laplacian, axis=0), 0.2, rtol=0.02)
    # heat for the time r^2 / 8 shrinks the normals by exp(-2 t / R^2)
    np.testing.assert_allclose(a, np.exp(2.0**2 / 4 / 10.0**2), rtol=0.002)


@pytest.mark.parametrize("shift_mm", [0.0, 0.03], ids=["even", "irregular"])
def test_cylinder(shift_mm: float) -> None:
    tube = irregular(shapes.cylinder(2.0, 8.0, 64, 33), on_cylinder, shift_mm)
    found = features(tube, 0.6, FeaturesSettings())
    inside = found.border_distance_mm > 1.0
    np.testing.assert_allclose(found.values[inside, 1], 1 / 4, rtol=0.02)
    np.testing.assert_allclose(found.values[inside, 2], 0, atol=0.02 / 2**2)


def test_an_open_border_has_no_false_curvature() -> None:
    """Up to the border itself the averages are those of the middle: a border vertex has an angle, but no
    curvature.
    """
    found = features(shapes.cylinder(2.0, 8.0, 64, 33), 0.6, FeaturesSettings())
    np.testing.assert_allclose(found.values[:, 1], 1 / 4, rtol=0.01)
    np.testing.assert_allclose(found.values[:, 2], 0, atol=1e-3)
    assert found.border_distance_mm.max() == pytest.approx(4.0, rel=1e-6)


@pytest.mark.parametrize("shift_mm", [0.0, 0.013], ids=["even", "irregular"])
def test_torus(shift_mm: float) -> None:
    """Across the tube at angle v: H = (1/2 + cos v / (5 + 2 cos v)) / 2, G = cos v / (2 (5 + 2 cos v))."""
    mesh = irregular(shapes.torus(5, 2, 144, 72), on_torus, shift_mm)
    found = features(mesh, 0.5, FeaturesSettings())
    ring = np.hypot(mesh.vertices[:, 0], mesh.vertices[:, 1])
    cosine = (ring - 5) / 2
    mean, gaussian = (1 / 2 + cosine / ring) / 2, cosine / (2 * ring)
    np.testing.assert_allclose(found.values[:, 1], mean, atol=0.02 * mean.max())
    np.testing.assert_allclose(found.values[:, 2], gaussian, atol=0.02 * np.abs(gaussian).max())


@pytest.mark.parametrize("shift_edges", [0.0, 0.1], ids=["even", "irregular"])
def test_saddle_and_plane(shift_edges: float) -> None:
    """z = k (x^2 - y^2): G = -4 k^2 / (1 + 4 k^2 (x^2 + y^2))^2, H = 0 in the middle."""
    flat = shapes.grid_plane(60, 60)
    shift = np.random.default_rng(0).normal(0, shift_edges, (len(flat.vertices), 2))
    xy, k = flat.vertices[:, :2] - flat.vertices[:, :2].mean(axis=0) + shift, 0.5 / 59
    saddle = features(
        Mesh(np.column_stack([xy, k * (xy[:, 0] ** 2 - xy[:, 1] ** 2)]), flat.faces), 4.0, FeaturesSettings()
    )
    middle = np.hypot(*xy.T) < 7
    gaussian = -4 * k**2 / (1 + 4 * k**2 * (xy[middle] ** 2).sum(axis=1)) ** 2
    np.testing.assert_allclose(saddle.values[middle, 2], gaussian, rtol=0.02)
    np.testing.assert_allclose(saddle.values[middle, 1], 0, atol=0.02 * 2 * k)

    plane = features(Mesh(np.column_stack([xy, 0 * xy[:, 0]]), flat.faces), 4.0, FeaturesSettings())
    np.testing.assert_allclose(plane.values, np.tile([1.0, 0, 0, 0, 0, 0], (len(xy), 1)), atol=1e-9)


def test_paper_features_are_integrated_in_file_units() -> None:
    mesh = shapes.bumpy_blob(3)
    values = features(mesh, 3.0, FeaturesSettings(kind="integrated")).values
    assert values[:, 0].sum() == pytest.approx(mesh.face_areas_mm2().sum())
    assert values[:, 2].sum() == pytest.approx(4 * np.pi)
    np.testing.assert_allclose(values[:, 1], 0.5 * np.linalg.norm(values[:, 3:], axis=1))


def test_integrated_features_have_the_angle_of_a_border_physical_ones_do_not() -> None:
    flat = shapes.grid_plane(12, 12)
    corner = int(np.flatnonzero((flat.vertices[:, :2] == flat.vertices[:, :2].min(axis=0)).all(axis=1))[0])
    assert features(flat, 3.0, FeaturesSettings(kind="integrated")).values[corner, 2] > 1.0
    assert abs(features(flat, 3.0, FeaturesSettings()).values[corner, 2]) < 1e-9


def test_a_vertex_without_a_triangle_has_finite_features() -> None:
    blob = shapes.bumpy_blob(2)
    lonely = Mesh(np.concatenate([blob.vertices, [[90.0, 0, 0]]]), blob.faces)
    assert np.isfinite(features(lonely, 3.0, FeaturesSettings()).values).all()
