"""Features and landmarks do not depend on how the part lies, in which unit it is, or how vertices are numbered."""

import numpy as np
import pytest
from scipy.stats import f as f_distribution

from pipeline.kernels.geodesics import GeodesicSolver
from pipeline.mesh import Mesh
from pipeline.settings import FeaturesSettings, LandmarksSettings, SegmentationSettings, Settings
from pipeline.stages.features import Features, features
from pipeline.stages.geodesics import geodesics
from pipeline.stages.landmarks import LandmarkSet, hotelling_t2, landmarks, scaled, strongest_apart, t2_limit
from pipeline.stages.segmentation import Segmentation, segment
from tests import shapes


def analysed(mesh: Mesh, radius_mm: float, settings: Settings) -> tuple[Segmentation, Features, LandmarkSet]:
    size_mm = float(np.sqrt(mesh.face_areas_mm2().sum()))
    distances = geodesics(mesh, "mesh", size_mm, settings.geodesics, settings.segmentation)
    segmentation = segment(mesh, "mesh", distances, settings.segmentation)
    measured = features(mesh, distances.surface, radius_mm, settings.features)
    return segmentation, measured, landmarks(mesh, segmentation, measured, settings.landmarks)


@pytest.fixture(scope="module")
def blob() -> Mesh:
    return shapes.bumpy_blob(4)


@pytest.mark.parametrize(
    ("settings", "factor"),
    [(Settings(), 1000.0), (Settings(), 1.0), (Settings.paper(), 1.0)],
    ids=["default, metres", "default", "paper"],
)
def test_turning_and_scaling_the_part_keeps_its_landmarks(blob: Mesh, settings: Settings, factor: float) -> None:
    _, _, before = analysed(blob, 3.0, settings)
    moved = blob.moved(shapes.motion(5))
    _, _, after = analysed(Mesh(moved.vertices * factor, moved.faces), 3.0 * factor, settings)
    assert len(before.vertex) > 0
    np.testing.assert_array_equal(before.vertex, after.vertex)
    np.testing.assert_allclose(before.t2, after.t2, rtol=1e-6)


def test_renumbering_vertices_and_faces_keeps_the_positions(blob: Mesh) -> None:
    rng = np.random.default_rng(2)
    old_of_new = rng.permutation(len(blob.vertices))
    new_of_old = np.argsort(old_of_new)
    renumbered = Mesh(blob.vertices[old_of_new], rng.permutation(new_of_old[blob.faces]))
    settings = Settings()
    _, _, before = analysed(blob, 3.0, settings)
    _, _, after = analysed(renumbered, 3.0, settings)
    assert set(old_of_new[after.vertex]) == set(before.vertex)


def test_a_plane_has_no_landmarks() -> None:
    plane = shapes.grid_plane(40, 30)
    rough = Mesh(plane.vertices + np.random.default_rng(0).normal(0, 1e-3, plane.vertices.shape), plane.faces)
    _, _, found = analysed(rough, 4.0, Settings())
    assert len(found.vertex) == 0


def test_no_landmark_lies_near_an_open_border(blob: Mesh) -> None:
    keep = (blob.vertices[blob.faces][:, :, 2] > 0).all(axis=1)
    half = Mesh(blob.vertices, blob.faces[keep])
    used = np.unique(half.faces)
    half = Mesh(half.vertices[used], np.searchsorted(used, half.faces))
    settings = Settings(segmentation=SegmentationSettings(min_component_share=0.0))
    _, measured, found = analysed(half, 2.0, settings)
    assert len(found.vertex) > 0
    assert (measured.border_distance_mm[found.vertex] >= settings.landmarks.border_distance_radii * 2.0).all()


@pytest.mark.parametrize("triangles", ["even", "uneven"])
def test_sphere_features_are_its_curvatures(triangles: str) -> None:
    sphere = shapes.icosphere(10.0, 4)
    if triangles == "uneven":
        rng = np.random.default_rng(0)
        v = sphere.vertices + rng.normal(0, 0.12, sphere.vertices.shape)
        sphere = Mesh(10 * v / np.linalg.norm(v, axis=1, keepdims=True), sphere.faces)
    measured = features(sphere, GeodesicSolver(sphere.vertices, sphere.faces), 3.0, FeaturesSettings())
    area_ratio, mean, gaussian, laplacian = np.split(measured.values, [1, 2, 3], axis=1)
    np.testing.assert_allclose(mean, 0.1, rtol=0.05)
    np.testing.assert_allclose(gaussian, 0.01, rtol=0.08)
    np.testing.assert_allclose(np.linalg.norm(laplacian, axis=1), 0.2, rtol=0.05)
    assert np.ptp(area_ratio) < 0.1


def test_paper_features_are_integrated_in_file_units() -> None:
    mesh = shapes.bumpy_blob(3)
    measured = features(mesh, GeodesicSolver(mesh.vertices, mesh.faces), 3.0, FeaturesSettings(kind="integrated"))
    areas = measured.values[:, 0]
    assert areas.sum() == pytest.approx(mesh.face_areas_mm2().sum())
    assert measured.values[:, 2].sum() == pytest.approx(4 * np.pi)
    np.testing.assert_allclose(measured.values[:, 1], 0.5 * np.linalg.norm(measured.values[:, 3:], axis=1))


def test_t2_of_two_components_is_mahalanobis() -> None:
    values = np.random.default_rng(0).normal(size=(200, 2)) @ np.array([[3.0, 1.0], [0.0, 0.5]])
    centred = values - values.mean(axis=0)
    inverse = np.linalg.inv(np.cov(centred.T))
    np.testing.assert_allclose(hotelling_t2(centred), np.einsum("ki,ij,kj->k", centred, inverse, centred))


def test_a_second_component_without_variance_counts_nothing() -> None:
    line = np.outer(np.arange(10.0) - 4.5, [1.0, 2.0, 0, 0, 0, 0])
    t2 = hotelling_t2(line)
    np.testing.assert_allclose(t2, (np.arange(10) - 4.5) ** 2 / np.var(np.arange(10), ddof=1))


def test_limit_is_the_printed_formula_and_marks_three_percent_of_normal_data() -> None:
    n = 500
    assert t2_limit(n, 0.97) == 2 * (n**2 - 1) / (n * (n - 2)) * f_distribution.ppf(0.97, 2, n - 2)
    values = np.random.default_rng(1).normal(size=(20_000, 6))
    share = (hotelling_t2(scaled(values, standardize=True)) > t2_limit(20_000, 0.97)).mean()
    assert share == pytest.approx(0.03, abs=0.004)


def test_strongest_apart_keeps_the_first_of_each_neighbourhood() -> None:
    points = np.array([[0.0, 0, 0], [0.5, 0, 0], [1.2, 0, 0], [5, 0, 0]])
    np.testing.assert_array_equal(strongest_apart(points, 1.0), [0, 2, 3])
    np.testing.assert_array_equal(strongest_apart(points, 0.0), [0, 1, 2, 3])


def test_halo_is_left_out_when_asked(blob: Mesh) -> None:
    settings = Settings(landmarks=LandmarksSettings(include_halo=False))
    segmentation, _, found = analysed(blob, 3.0, settings)
    assert not segmentation.halo[found.vertex].any()
