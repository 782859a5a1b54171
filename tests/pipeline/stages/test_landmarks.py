"""Landmarks do not depend on how the part lies, in which unit it is, or how it is numbered; flat surface
has none.
"""

import numpy as np
import pytest
from scipy.stats import f as f_distribution

from pipeline.core.mesh import FloatArray, Mesh
from pipeline.core.settings import LandmarksSettings, SegmentationSettings, Settings
from pipeline.kernels import peaks
from pipeline.stages.features import Features, features
from pipeline.stages.geodesics import geodesics
from pipeline.stages.landmarks import (
    LandmarkSet,
    hotelling_t2,
    landmarks,
    scaled,
    strongest_apart,
    t2_limit,
    t2_scores,
)
from pipeline.stages.segmentation import Segmentation, segment
from tests.support import shapes


def analysed(mesh: Mesh, radius_mm: float, settings: Settings) -> tuple[Segmentation, Features, LandmarkSet]:
    """On the mesh itself, without resampling: what remains are the stages' own properties."""
    size_mm = float(np.sqrt(mesh.face_areas_mm2().sum()))
    distances = geodesics(mesh, "mesh", size_mm, settings.geodesics, settings.segmentation)
    segmentation = segment(mesh, "mesh", distances, settings.segmentation)
    measured = features(mesh, radius_mm, settings.features)
    return (
        segmentation,
        measured,
        landmarks(mesh, distances.surface, segmentation, measured, settings.landmarks),
    )


def half(mesh: Mesh, above_mm: float = 0.0) -> Mesh:
    keep = (mesh.vertices[mesh.faces][:, :, 2] > above_mm).all(axis=1)
    used = np.unique(mesh.faces[keep])
    return Mesh(mesh.vertices[used], np.searchsorted(used, mesh.faces[keep]))


@pytest.fixture(scope="module")
def blob() -> Mesh:
    return shapes.bumpy_blob(4)


@pytest.mark.parametrize("turn", [1, 5])
@pytest.mark.parametrize(
    ("settings", "factor"),
    [(Settings(), 1000.0), (Settings(), 1.0), (Settings.paper(), 1.0)],
    ids=["default, metres", "default", "paper"],
)
def test_turning_and_scaling_the_part_keeps_its_landmarks(
    blob: Mesh, settings: Settings, factor: float, turn: int
) -> None:
    _, _, before = analysed(blob, 4.0, settings)
    T = shapes.motion(turn)
    moved = blob.moved(T)
    _, _, after = analysed(Mesh(moved.vertices * factor, moved.faces), 4.0 * factor, settings)
    assert len(before.vertex) > 3
    np.testing.assert_array_equal(before.vertex, after.vertex)
    np.testing.assert_allclose(before.t2, after.t2, rtol=1e-6)
    np.testing.assert_allclose(before.strength, after.strength, rtol=1e-6)
    expected = (before.position_mm @ T[:3, :3].T + T[:3, 3]) * factor
    np.testing.assert_allclose(after.position_mm, expected, atol=1e-6 * factor)


def test_renumbering_vertices_and_faces_keeps_the_positions(blob: Mesh) -> None:
    rng = np.random.default_rng(2)
    old_of_new = rng.permutation(len(blob.vertices))
    new_of_old = np.argsort(old_of_new)
    renumbered = Mesh(blob.vertices[old_of_new], rng.permutation(new_of_old[blob.faces]))
    _, _, before = analysed(blob, 4.0, Settings())
    _, _, after = analysed(renumbered, 4.0, Settings())
    np.testing.assert_array_equal(old_of_new[after.vertex], before.vertex)
    np.testing.assert_allclose(after.position_mm, before.position_mm, atol=1e-6)


def test_landmarks_are_found_again_on_other_triangles(blob: Mesh) -> None:
    """The same surface sampled at other points: every landmark of one within a quarter of the feature
    radius.
    """
    _, _, first = analysed(blob, 4.0, Settings())
    _, _, again = analysed(shapes.bumpy_blob(4, triangulation=3), 4.0, Settings())
    apart = np.linalg.norm(first.position_mm[:10, None] - again.position_mm[None], axis=2).min(axis=1)
    assert (apart < 1.0).sum() >= 9


def test_each_bump_has_its_landmark(blob: Mesh) -> None:
    """`bumpy_blob` is a ball with bumps in known directions: the five that stand out are marked near
    their tops.
    """
    _, _, found = analysed(blob, 4.0, Settings())
    towards = found.position_mm / [1.0, 0.8, 0.65]
    towards /= np.linalg.norm(towards, axis=1, keepdims=True)
    for bump in [(1, 0.2, 0.1), (-0.3, 1, 0.4), (0.2, -0.5, 1), (-1, -0.6, 0.3), (-0.4, 0.3, -0.9)]:
        assert (towards @ (np.array(bump) / np.linalg.norm(bump))).max() > np.cos(np.radians(12))


@pytest.mark.parametrize("shape", ["rough plane", "sphere", "rough sphere"])
def test_where_there_is_nothing_to_mark_there_are_no_landmarks(shape: str) -> None:
    """Roughness of 0.1 % of the size."""
    mesh = shapes.grid_plane(40, 30) if shape == "rough plane" else shapes.icosphere(10.0, 4)
    if shape.startswith("rough"):
        noise = np.random.default_rng(0).normal(0, 1e-3 * mesh.diagonal_mm, len(mesh.vertices))
        mesh = Mesh(mesh.vertices + noise[:, None] * mesh.vertex_normals(), mesh.faces)
    radius_mm = 0.1 * float(np.sqrt(mesh.face_areas_mm2().sum()))
    _, _, found = analysed(mesh, radius_mm, Settings())
    assert len(found.vertex) == 0


@pytest.mark.parametrize("above_mm", [0.0, -4.0])
def test_no_landmark_lies_near_an_open_border(blob: Mesh, above_mm: float) -> None:
    settings = Settings(segmentation=SegmentationSettings(min_component_share=0.0))
    _, measured, found = analysed(half(blob, above_mm), 4.0, settings)
    assert len(found.vertex) > 0
    zone_mm = settings.landmarks.border_distance_radii * 4.0
    assert (measured.border_distance_mm[found.vertex] >= 0.9 * zone_mm).all()  # of the nearest vertex


def test_spacing_count_and_order(blob: Mesh) -> None:
    settings = Settings(landmarks=LandmarksSettings(spacing_radii=1.5, count=7))
    _, _, found = analysed(blob, 4.0, settings)
    assert len(found.vertex) == 7
    assert (np.diff(found.strength) <= 0).all()
    apart = np.linalg.norm(found.position_mm[:, None] - found.position_mm[None], axis=2)[
        np.triu_indices(7, 1)
    ]
    assert apart.min() > 6.0
    _, _, unlimited = analysed(blob, 4.0, Settings(landmarks=LandmarksSettings(spacing_radii=1.5)))
    np.testing.assert_array_equal(unlimited.vertex[:7], found.vertex)


def test_competitors_give_as_many_points_as_t2(blob: Mesh) -> None:
    _, _, ours = analysed(blob, 4.0, Settings())
    for detector in ("gaussian_curvature", "iss", "farthest", "random"):
        section = LandmarksSettings.model_validate({"detector": detector})
        _, _, theirs = analysed(blob, 4.0, Settings(landmarks=section))
        assert len(theirs.vertex) == len(ours.vertex), detector


def test_a_low_segment_beside_a_high_one_keeps_its_landmarks() -> None:
    """T^2 has the size of spread of the segment: a low bump is as far out in its own surroundings as a
    high one.
    """
    flat = shapes.grid_plane(60, 60)
    x, y = (flat.vertices[:, :2] - flat.vertices[:, :2].mean(axis=0)).T
    high, low = (h * np.exp(-((x - c) ** 2 + y**2) / 20.0) for h, c in ((4.0, -15.0), (1.2, 15.0)))
    mesh = Mesh(np.column_stack([x, y, high + low]), flat.faces)
    measured = features(mesh, 5.0, Settings().features)
    labels, halo = (x > 0).astype(np.int64), np.zeros(len(x), dtype=np.bool_)
    scores = t2_scores(measured, labels, halo, LandmarksSettings(confidence=0.9))
    tops = [int(np.argmin((x - c) ** 2 + y**2)) for c in (-15.0, 15.0)]
    assert scores.field[tops[0]] > 3 * scores.field[tops[1]]  # the part's T^2 tells them apart
    assert (scores.t2[tops] > scores.limit[tops]).all()


def test_t2_of_two_components_is_mahalanobis() -> None:
    values = np.random.default_rng(0).normal(size=(200, 2)) @ np.array([[3.0, 1.0], [0.0, 0.5]])
    centred = values - values.mean(axis=0)
    inverse = np.linalg.inv(np.cov(centred.T))
    np.testing.assert_allclose(hotelling_t2(centred), np.einsum("ki,ij,kj->k", centred, inverse, centred))


def test_a_second_component_without_variance_counts_nothing() -> None:
    line = np.outer(np.arange(10.0) - 4.5, [1.0, 2.0, 0, 0, 0, 0])
    t2 = hotelling_t2(line)
    np.testing.assert_allclose(t2, (np.arange(10) - 4.5) ** 2 / np.var(np.arange(10), ddof=1))


def test_weights_are_repetitions() -> None:
    rng = np.random.default_rng(3)
    values, times = rng.normal(size=(60, 3)), rng.integers(1, 5, 60)
    centred = values - np.average(values, axis=0, weights=times)
    n = times.sum()
    repeated = hotelling_t2(np.repeat(centred, times, axis=0)) * n / (n - 1)
    np.testing.assert_allclose(np.repeat(hotelling_t2(centred, times.astype(float)), times), repeated)


def test_limit_is_the_printed_formula_and_marks_three_percent_of_normal_data() -> None:
    n = 500
    assert t2_limit(n, 0.97) == 2 * (n**2 - 1) / (n * (n - 2)) * f_distribution.ppf(0.97, 2, n - 2)
    values = np.random.default_rng(1).normal(size=(20_000, 6))
    share = (hotelling_t2(scaled(values, standardize=True)) > t2_limit(20_000, 0.97)).mean()
    assert share == pytest.approx(0.03, abs=0.004)


def test_paper_marks_about_three_percent_outside_the_halo(blob: Mesh) -> None:
    segmentation, _, found = analysed(blob, 4.0, Settings.paper())
    assert 0 < found.limit_share < 0.06
    assert not segmentation.halo[found.vertex].any()
    assert (found.strength > 1).all()


def test_strongest_apart_keeps_the_first_of_each_neighbourhood() -> None:
    points = np.array([[0.0, 0, 0], [0.5, 0, 0], [1.2, 0, 0], [5, 0, 0]])
    np.testing.assert_array_equal(strongest_apart(points, 1.0), [0, 2, 3])
    np.testing.assert_array_equal(strongest_apart(points, 0.0), [0, 1, 2, 3])


def bump(centre: tuple[float, float], along: float) -> tuple[Mesh, FloatArray]:
    flat = shapes.grid_plane(20, 20)
    x, y = flat.vertices[:, 0] - centre[0], flat.vertices[:, 1] - centre[1]
    return flat, 10.0 - x**2 - along * y**2


def test_a_peak_is_found_between_the_vertices() -> None:
    mesh, field = bump((9.3, 8.6), 0.5)
    start = int(field.argmax())
    found = peaks.located(mesh, field, np.array([start]), 3.0)
    np.testing.assert_allclose(found.position_mm[0], [9.3, 8.6, 0.0], atol=1e-9)
    assert found.value[0] == pytest.approx(10.0) and found.sharpness[0] == pytest.approx(1.0)


def test_a_ridge_is_not_sharp() -> None:
    mesh, field = bump((9.3, 8.6), 0.0)
    found = peaks.located(mesh, field, np.array([int(field.argmax())]), 3.0)
    assert found.sharpness[0] == pytest.approx(0.0, abs=1e-9)


def test_a_maximum_is_located_on_the_top_of_a_pin_with_few_vertices() -> None:
    """Seven vertices are too few for six coefficients; a round field has four."""
    around = np.arange(6) * np.pi / 3
    rim = np.column_stack([np.cos(around), np.sin(around), np.zeros(6)])
    faces = np.array([[0, 1 + k, 1 + (k + 1) % 6] for k in range(6)])
    mesh, top = Mesh(np.concatenate([np.zeros((1, 3)), rim]), faces), np.array([0.2, -0.1, 0.0])
    field = 5.0 - 3.0 * ((mesh.vertices - top) ** 2).sum(axis=1)
    found = peaks.located(mesh, field, np.array([0]), 2.5)
    assert found.position_mm[0] == pytest.approx(top)
    assert (found.value[0], found.sharpness[0]) == pytest.approx((5.0, 6.0))
