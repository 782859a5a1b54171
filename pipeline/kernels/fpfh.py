"""Fast point feature histograms (Rusu, Blodow & Beetz 2009), and their values under a reflection without
a second computation.

A histogram has 33 bins: 11 for each of the three angles (theta, alpha, phi) between the normals of a point
and its neighbours. Computed by `native/fpfh.cpp`, equal to Open3D's up to rounding.
"""

import os

import numpy as np

from pipeline.core.mesh import FloatArray, IndexArray, Mesh
from pipeline.kernels.native import core

BINS = 11  # for each angle; Open3D's layout


def fpfh(mesh: Mesh, radius_mm: float, at: IndexArray | None = None) -> FloatArray:
    """(n, 33) histograms at every vertex of `mesh`, over the neighbours nearer than `radius_mm`; with `at`
    (k,) only at those vertices: (k, 33), the same bits in less time.

    The same bits with any number of threads.
    """
    at = np.arange(len(mesh.vertices)) if at is None else at
    vertices = np.ascontiguousarray(mesh.vertices, dtype=np.float64)
    normals = np.ascontiguousarray(mesh.vertex_normals(), dtype=np.float64)
    return np.asarray(
        core.fpfh(
            vertices,
            normals,
            np.ascontiguousarray(at, dtype=np.int64),
            radius_mm,
            len(os.sched_getaffinity(0)),
        )
    )


def flip_normals(histograms: FloatArray) -> FloatArray:
    """(n, 33) `fpfh` of the same surface with every normal reversed.

    Theta and phi change sign, alpha stays: the bins of theta and phi are reversed.
    """
    theta, alpha, phi = _angles(histograms)
    return np.concatenate([theta[:, ::-1], alpha, phi[:, ::-1]], axis=1)


def mirror(histograms: FloatArray) -> FloatArray:
    """(n, 33) `fpfh` of the mirror image of the surface, its normals still outward.

    Alpha alone changes sign: its bins are reversed.
    """
    theta, alpha, phi = _angles(histograms)
    return np.concatenate([theta, alpha[:, ::-1], phi], axis=1)


def _angles(histograms: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    return histograms[:, :BINS], histograms[:, BINS : 2 * BINS], histograms[:, 2 * BINS :]
