"""Differential quantities of a triangle mesh: cotangent Laplacian, mean and Gaussian curvature.

Meyer, Desbrun, Schroeder, Barr, "Discrete differential-geometry operators for triangulated 2-manifolds"
(2003), with lumped (barycentric) areas. An integrated value is the integral over the barycentric area of a
vertex; divided by this area it is the pointwise value. Sign: the mean curvature is positive where the surface
is convex (normals point outwards).
"""

import numpy as np
from scipy.sparse import coo_matrix, csr_matrix

from pipeline.core.mesh import FloatArray, Mesh
from pipeline.kernels import topology
from pipeline.kernels.surface import corner_angles

#: Limit of a cotangent, no unit: a larger one comes from a degenerate triangle. Chosen by hand, not fitted.
_MAX_COT = 1e3
#: Lower limit of a sine, no unit; avoids a division by 0. Chosen by hand, not fitted.
_MIN_SINE = 1e-12


def cotangent_laplacian(mesh: Mesh) -> csr_matrix:
    """(n, n) L with (L f)_i = sum_j (cot a_ij + cot b_ij) / 2 (f_j - f_i); symmetric, rows sum to 0.

    a_ij, b_ij : the angles opposite edge ij. No unit (Meyer et al. 2003, without the division by the area).
    """
    angles = corner_angles(mesh.vertices[mesh.faces])
    half_cot = np.clip(np.cos(angles) / np.maximum(np.sin(angles), _MIN_SINE), -_MAX_COT, _MAX_COT) / 2
    i = mesh.faces[:, [1, 2, 0]].ravel()
    j = mesh.faces[:, [2, 0, 1]].ravel()
    n = len(mesh.vertices)
    upper = coo_matrix((half_cot.ravel(), (i, j)), shape=(n, n)).tocsr()
    weights = upper + upper.T
    diagonal = np.asarray(weights.sum(axis=1)).ravel()
    return csr_matrix(weights - coo_matrix((diagonal, (np.arange(n), np.arange(n))), shape=(n, n)).tocsr())


def integrated_laplacian(mesh: Mesh) -> FloatArray:
    """(n, 3) mm: L applied to the positions, which is 2 H n_in times the vertex area.

    H : mean curvature, 1/mm; n_in : unit normal towards the concave side
    """
    return np.asarray(cotangent_laplacian(mesh) @ mesh.vertices, dtype=np.float64)


def angle_defect(mesh: Mesh, *, border_correction: bool) -> FloatArray:
    """(n,) integrated Gaussian curvature, no unit: 2 pi minus the sum of the angles at the vertex.

    border_correction : on border vertices take pi instead of 2 pi
    """
    n = len(mesh.vertices)
    angle_sum = np.bincount(
        mesh.faces.ravel(), weights=corner_angles(mesh.vertices[mesh.faces]).ravel(), minlength=n
    )
    full = np.full(n, 2 * np.pi)
    if border_correction:
        full[topology.border_vertices(mesh.faces, n)] = np.pi
    return full - angle_sum


def averaging(mesh: Mesh, near: csr_matrix, radius_mm: float) -> csr_matrix:
    """(n, n) averaging matrix, rows sum to 1: weights area_j exp(-2 (d_ij / radius)^2) in the geodesic disc.

    near : (n, n), geodesic distances d_ij in mm of the pairs i != j with d_ij <= radius as stored entries
    """
    areas = mesh.vertex_areas_mm2()
    n = len(areas)
    kernel = near.copy()
    kernel.data = np.exp(-2.0 * (near.data / radius_mm) ** 2)
    kernel = kernel + coo_matrix((np.ones(n), (np.arange(n), np.arange(n))), shape=(n, n)).tocsr()
    weighted = csr_matrix(kernel.multiply(areas[None, :]))
    total = np.asarray(weighted.sum(axis=1)).ravel()
    return csr_matrix(weighted.multiply(1.0 / total[:, None]))
