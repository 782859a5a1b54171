"""Descriptors are those of Open3D; those of a reflected surface, and of one with flipped normals, need no
second computation.
"""

import numpy as np
import open3d as o3d
import pytest

from pipeline.core.mesh import FloatArray, Mesh
from pipeline.kernels.fpfh import flip_normals, fpfh, mirror
from pipeline.kernels.native import core
from pipeline.search.types import mirror_mesh
from tests.support import shapes

RADIUS_MM = 15.0


def median_error(estimated: FloatArray, direct: FloatArray) -> float:
    return float(np.median(np.linalg.norm(estimated - direct, axis=1) / np.linalg.norm(direct, axis=1)))


def test_mirrored_descriptors_are_those_of_the_mirror_image() -> None:
    blob = shapes.bumpy_blob(3)
    descriptors, direct = fpfh(blob, RADIUS_MM), fpfh(mirror_mesh(blob), RADIUS_MM)
    assert median_error(mirror(descriptors), direct) < 0.02 < median_error(descriptors, direct)


def test_flipped_descriptors_are_those_of_the_reversed_surface() -> None:
    blob = shapes.bumpy_blob(3)
    reversed_mesh = Mesh(blob.vertices, blob.faces[:, ::-1])
    descriptors, direct = fpfh(blob, RADIUS_MM), fpfh(reversed_mesh, RADIUS_MM)
    assert median_error(flip_normals(descriptors), direct) < 0.02 < median_error(descriptors, direct)


def test_both_reflections_undo_themselves() -> None:
    histograms = np.random.default_rng(0).random((5, 33))
    assert np.array_equal(mirror(mirror(histograms)), histograms)
    assert np.array_equal(flip_normals(flip_normals(histograms)), histograms)


def reference(mesh: Mesh, radius_mm: float) -> FloatArray:
    """Open3D's."""
    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(np.array(mesh.vertices)))
    cloud.normals = o3d.utility.Vector3dVector(np.array(mesh.vertex_normals()))
    search = o3d.geometry.KDTreeSearchParamRadius(radius_mm)
    return np.asarray(o3d.pipelines.registration.compute_fpfh_feature(cloud, search).data).T


@pytest.mark.parametrize("radius_mm", [0.01, 1.0, RADIUS_MM, 1000.0])
def test_they_are_those_of_open3d(radius_mm: float) -> None:
    """From a radius without a neighbour to one that takes in the whole part."""
    blob = shapes.bumpy_blob(2)
    np.testing.assert_allclose(fpfh(blob, radius_mm), reference(blob, radius_mm), rtol=1e-9, atol=1e-9)


def test_flat_surfaces_and_doubled_points_have_those_of_open3d() -> None:
    """Where angles are zero, equal or undefined."""
    x, y = np.meshgrid(np.arange(6.0), np.arange(5.0))
    plane = np.column_stack([x.ravel(), y.ravel(), np.zeros(30)])
    first = np.array([6 * row + column for row in range(4) for column in range(5)])
    faces = np.concatenate(
        [np.column_stack([first, first + 1, first + 7]), np.column_stack([first, first + 7, first + 6])]
    )
    doubled = Mesh(np.concatenate([plane, plane]), np.concatenate([faces, faces + 30]))
    for mesh in (Mesh(plane, faces), doubled):
        np.testing.assert_allclose(fpfh(mesh, 2.1), reference(mesh, 2.1), rtol=1e-9, atol=1e-9)


def test_some_vertices_have_the_bits_that_they_have_among_all() -> None:
    blob = shapes.bumpy_blob(3)
    some = np.array([7, 3, 3, 640])
    np.testing.assert_array_equal(fpfh(blob, RADIUS_MM, some), fpfh(blob, RADIUS_MM)[some])
    with pytest.raises(IndexError):
        fpfh(blob, RADIUS_MM, np.array([len(blob.vertices)]))


def test_threads_do_not_change_one_bit() -> None:
    blob = shapes.bumpy_blob(3)
    every = np.arange(len(blob.vertices))
    one, four = (core.fpfh(blob.vertices, blob.vertex_normals(), every, RADIUS_MM, n) for n in (1, 4))
    np.testing.assert_array_equal(one, four)
