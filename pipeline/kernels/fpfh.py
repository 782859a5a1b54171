"""Fast point feature histograms (Rusu, Blodow & Beetz 2009), and their values under a reflection without
a second computation.

A histogram has 33 bins: 11 for each of the three angles (theta, alpha, phi) between the normals of a point
and its neighbours.
"""

import numpy as np
import open3d as o3d

from pipeline.core.mesh import FloatArray, Mesh

BINS = 11  # for each angle; open3d's layout


def fpfh(mesh: Mesh, radius_mm: float) -> FloatArray:
    """(n, 33) histograms at every vertex of `mesh`, over the neighbours within `radius_mm`."""
    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(np.array(mesh.vertices)))
    cloud.normals = o3d.utility.Vector3dVector(mesh.vertex_normals())
    feature = o3d.pipelines.registration.compute_fpfh_feature(
        cloud, o3d.geometry.KDTreeSearchParamRadius(radius_mm)
    )
    return np.ascontiguousarray(np.asarray(feature.data, dtype=np.float64).T)


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
