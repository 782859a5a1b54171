"""Descriptors of a reflected surface, and of one with flipped normals, without computing them again."""

import numpy as np

from pipeline.core.mesh import FloatArray, Mesh
from pipeline.kernels.fpfh import flip_normals, fpfh, mirror
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
