"""ISS against closed forms, and open3d's keypoints against the definition."""

import numpy as np

from pipeline.kernels import iss
from tests.support import shapes


def test_saliency_is_the_least_eigenvalue_of_the_covariance() -> None:
    blob = shapes.bumpy_blob(3).vertices
    found = iss.saliency_mm2(blob, 6.0)
    for vertex in (0, 77, 400):
        near = blob[np.linalg.norm(blob - blob[vertex], axis=1) <= 6.0]
        np.testing.assert_allclose(found[vertex], np.linalg.eigvalsh(np.cov(near.T, bias=True))[0], rtol=1e-9)


def test_a_plane_has_no_saliency_wherever_it_lies() -> None:
    plane = shapes.grid_plane(20, 20).moved(shapes.motion(4, 1e4))
    assert iss.saliency_mm2(plane.vertices, 4.0).max() < 1e-6


def test_a_box_has_keypoints_near_its_edges_only() -> None:
    box = shapes.box((9.0, 8.0, 7.0), 4).moved(shapes.motion(1)).vertices
    found = iss.keypoints(box)
    assert found.keypoint.any()
    assert found.saliency[found.keypoint].min() > 1e-3 * found.saliency.max()


def test_keypoints_are_the_vertices_with_most_saliency_around() -> None:
    blob = shapes.bumpy_blob(4).vertices
    found = iss.keypoints(blob)
    assert found.keypoint.sum() >= 4
    spacing = np.sort(np.linalg.norm(blob[:, None] - blob[None, found.keypoint], axis=2), axis=0)[1].mean()
    for vertex in np.flatnonzero(found.keypoint):
        near = np.linalg.norm(blob - blob[vertex], axis=1) <= 3 * spacing
        assert found.saliency[vertex] == found.saliency[near].max()


def test_points_in_one_place_have_no_keypoints() -> None:
    for points in (np.zeros((0, 3)), np.zeros((1, 3)), np.ones((9, 3))):
        found = iss.keypoints(points)
        assert not found.keypoint.any()
        assert len(found.saliency) == len(points)
