"""Detectors name the same places however the part lies, in which unit it is, and however vertices are
numbered.
"""

import numpy as np
import pytest
from threadpoolctl import threadpool_limits

from pipeline.core.mesh import FloatArray, Mesh
from pipeline.core.settings import Detector, FeaturesSettings
from pipeline.kernels.geodesics import GeodesicSolver
from pipeline.stages.detectors import DETECTORS, DetectorInput, RankedKeypoints
from pipeline.stages.features import features
from tests.support import shapes

RADIUS_MM = 3.0
COUNT = 20
NAMED: list[Detector] = ["gaussian_curvature", "agd", "hks", "iss", "gp", "farthest"]
EVERY: list[Detector] = [*NAMED, "random"]
BY_MAXIMA: list[Detector] = ["gaussian_curvature", "agd", "hks", "iss"]


def scene(
    mesh: Mesh, radius_mm: float = RADIUS_MM, seed: int = 0, threads: int | None = None
) -> DetectorInput:
    surface = GeodesicSolver(mesh.vertices, mesh.faces, threads=threads)
    measured = features(mesh, radius_mm, FeaturesSettings())
    return DetectorInput(mesh, surface, measured, COUNT, radius_mm, seed)


def assert_ordered(found: RankedKeypoints) -> None:
    assert len(np.unique(found.vertex)) == len(found.vertex) == len(found.strength)
    assert np.isfinite(found.strength).all()
    assert (np.diff(found.strength) <= 0).all()


@pytest.fixture(scope="module")
def blob() -> DetectorInput:
    return scene(shapes.bumpy_blob(3))


def test_there_is_one_for_every_name_of_the_settings_but_t2() -> None:
    assert list(DETECTORS) == EVERY


@pytest.mark.parametrize("name", EVERY)
def test_every_vertex_is_a_candidate_the_best_first(name: Detector, blob: DetectorInput) -> None:
    found = DETECTORS[name](blob)
    assert_ordered(found)
    assert len(found.vertex) == len(blob.mesh.vertices)


@pytest.mark.parametrize("name", BY_MAXIMA)
def test_maxima_are_stronger_than_what_fills_up(name: Detector, blob: DetectorInput) -> None:
    strength = DETECTORS[name](blob).strength
    tops = int((strength >= 1).sum())
    assert 3 <= tops < 100
    assert strength[tops] <= 0.5


@pytest.mark.parametrize("factor", [1.0, 1000.0], ids=["turned", "turned, metres"])
@pytest.mark.parametrize("name", NAMED)
def test_turning_and_scaling_the_part_keeps_the_vertices(
    name: Detector, factor: float, blob: DetectorInput
) -> None:
    moved = blob.mesh.moved(shapes.motion(5))
    after = DETECTORS[name](scene(Mesh(moved.vertices * factor, moved.faces), RADIUS_MM * factor))
    before = DETECTORS[name](blob)
    np.testing.assert_array_equal(before.vertex[: 3 * COUNT], after.vertex[: 3 * COUNT])
    np.testing.assert_allclose(before.strength, after.strength, rtol=1e-4, atol=1e-6)


@pytest.mark.parametrize("name", NAMED)
def test_renumbering_vertices_and_faces_keeps_the_positions(name: Detector, blob: DetectorInput) -> None:
    rng = np.random.default_rng(2)
    old_of_new = rng.permutation(len(blob.mesh.vertices))
    faces = rng.permutation(np.argsort(old_of_new)[blob.mesh.faces])
    after = DETECTORS[name](scene(Mesh(blob.mesh.vertices[old_of_new], faces)))
    before = DETECTORS[name](blob)
    np.testing.assert_array_equal(before.vertex[: 3 * COUNT], old_of_new[after.vertex[: 3 * COUNT]])


@pytest.mark.parametrize("name", EVERY)
def test_threads_do_not_change_a_bit(name: Detector) -> None:
    mesh = shapes.bumpy_blob(3)
    found = []
    for threads in (1, 2):
        with threadpool_limits(limits=threads):
            found.append(DETECTORS[name](scene(mesh, threads=threads)))
    np.testing.assert_array_equal(found[0].vertex, found[1].vertex)
    np.testing.assert_array_equal(found[0].strength, found[1].strength)


def broken() -> Mesh:
    """An open tube, a closed blob, a triangle alone, a face without area and vertices of no face."""
    tube, blob = shapes.cylinder(4.0, 12.0, 24, 17), shapes.bumpy_blob(2)
    n, k = len(tube.vertices), len(tube.vertices) + len(blob.vertices)
    extra = np.array(
        [[60.0, 0, 0], [61, 0, 0], [60, 1, 0], [80, 0, 0], [81, 0, 0], [82, 0, 0], [0, 99, 0], [0, 99, 0]]
    )
    loose = np.array([[k, k + 1, k + 2], [k + 3, k + 4, k + 5]])
    return Mesh(
        np.concatenate([tube.vertices, blob.vertices + 30.0, extra]),
        np.concatenate([tube.faces, blob.faces + n, loose]),
    )


@pytest.mark.parametrize("name", EVERY)
def test_pieces_open_borders_and_lone_vertices_are_fine(name: Detector) -> None:
    mesh = broken()
    with np.errstate(divide="ignore", invalid="ignore"):  # features of a vertex without surface
        what_is_seen = scene(mesh)
    found = DETECTORS[name](what_is_seen)
    assert_ordered(found)
    assert len(found.vertex) >= 3 * COUNT
    assert (mesh.vertex_areas_mm2()[found.vertex] > 0).all()


@pytest.mark.parametrize("name", EVERY)
def test_a_lone_triangle_is_fine(name: Detector) -> None:
    mesh = Mesh(np.array([[0.0, 0, 0], [4, 0, 0], [0, 3, 0]]), np.array([[0, 1, 2]]))
    assert_ordered(DETECTORS[name](scene(mesh)))


def tips(mesh: Mesh, found: RankedKeypoints, count: int) -> FloatArray:
    return mesh.vertices[found.vertex[:count]]


@pytest.mark.parametrize("name", ["agd", "hks"])
def test_ends_of_a_long_part_come_first(name: Detector) -> None:
    long = shapes.icosphere(1.0, 3)
    stretched = Mesh(long.vertices * [12.0, 3.0, 2.5], long.faces)
    ends = tips(stretched, DETECTORS[name](scene(stretched, 1.5)), 2)
    np.testing.assert_allclose(np.sort(ends[:, 0]), [-12.0, 12.0], atol=0.5)


def test_gaussian_curvature_finds_the_corners_of_a_box() -> None:
    box = shapes.box((6.0, 5.0, 4.0), 3)
    corners = tips(box, DETECTORS["gaussian_curvature"](scene(box, 1.0)), 8)
    assert {tuple(point) for point in corners.tolist()} == {
        (x, y, z) for x in (0.0, 6.0) for y in (0.0, 5.0) for z in (0.0, 4.0)
    }


def test_random_follows_area_and_seed() -> None:
    """Two spheres of as many vertices, one with four times the area: it is drawn four times as often."""
    small, large = shapes.icosphere(5.0, 2), shapes.icosphere(10.0, 2)
    n = len(small.vertices)
    both = Mesh(
        np.concatenate([small.vertices + 50.0, large.vertices]),
        np.concatenate([small.faces, large.faces + n]),
    )
    base = scene(both)
    firsts = []
    for seed in range(400):
        drawn = DetectorInput(both, base.surface, base.features, COUNT, RADIUS_MM, seed)
        firsts.append(DETECTORS["random"](drawn).vertex[0] >= n)
    assert np.mean(firsts) == pytest.approx(0.8, abs=0.06)
    again = DETECTORS["random"](base).vertex
    np.testing.assert_array_equal(again, DETECTORS["random"](base).vertex)
