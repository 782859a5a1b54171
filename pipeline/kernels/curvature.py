"""The differential quantities of a triangle mesh: areas, cotangent Laplacian, curvatures.

Meyer, Desbrun, Schroeder, Barr, "Discrete differential-geometry operators for triangulated 2-manifolds"
(2003), with lumped (barycentric) areas. Integrated values are sums over a vertex' share of the surface;
dividing by its area gives pointwise ones. Sign: mean curvature is positive where the surface is convex
(normals point out).
"""

import numpy as np
from scipy.sparse import coo_matrix, csr_matrix

from pipeline.core.mesh import FloatArray, Mesh
from pipeline.kernels import topology
from pipeline.kernels.surface import corner_angles

_MAX_COT = 1e3  # a sliver's cotangent: beyond this it says nothing about the surface


def cotangent_laplacian(mesh: Mesh) -> csr_matrix:
    """(n, n) L with (L f)_i = sum_j (cot a_ij + cot b_ij) / 2 (f_j - f_i); symmetric, rows sum to 0."""
    angles = corner_angles(mesh.vertices[mesh.faces])
    half_cot = np.clip(np.cos(angles) / np.maximum(np.sin(angles), 1e-12), -_MAX_COT, _MAX_COT) / 2
    i = mesh.faces[:, [1, 2, 0]].ravel()
    j = mesh.faces[:, [2, 0, 1]].ravel()
    n = len(mesh.vertices)
    upper = coo_matrix((half_cot.ravel(), (i, j)), shape=(n, n)).tocsr()
    weights = upper + upper.T
    diagonal = np.asarray(weights.sum(axis=1)).ravel()
    return csr_matrix(weights - coo_matrix((diagonal, (np.arange(n), np.arange(n))), shape=(n, n)).tocsr())


def integrated_laplacian(mesh: Mesh) -> FloatArray:
    """(n, 3) L applied to the positions, mm: 2 H n_in times the vertex' area, n_in pointing to the concave
    side.
    """
    return np.asarray(cotangent_laplacian(mesh) @ mesh.vertices, dtype=np.float64)


def angle_defect(mesh: Mesh, *, border_correction: bool) -> FloatArray:
    """(n,) integrated Gaussian curvature: 2 pi minus the angles at the vertex; pi minus on a corrected
    border.
    """
    n = len(mesh.vertices)
    around = np.bincount(
        mesh.faces.ravel(), weights=corner_angles(mesh.vertices[mesh.faces]).ravel(), minlength=n
    )
    full = np.full(n, 2 * np.pi)
    if border_correction:
        full[topology.border_vertices(mesh.faces, n)] = np.pi
    return full - around


def averaging(mesh: Mesh, near: csr_matrix, radius_mm: float) -> csr_matrix:
    """(n, n) rows summing to 1: weights area_j exp(-2 (d_ij / radius)^2) over the geodesic disc.

    near : pairs i != j with d_ij <= radius as stored entries.
    """
    areas = mesh.vertex_areas_mm2()
    n = len(areas)
    kernel = near.copy()
    kernel.data = np.exp(-2.0 * (near.data / radius_mm) ** 2)
    kernel = kernel + coo_matrix((np.ones(n), (np.arange(n), np.arange(n))), shape=(n, n)).tocsr()
    weighted = csr_matrix(kernel.multiply(areas[None, :]))
    total = np.asarray(weighted.sum(axis=1)).ravel()
    return csr_matrix(weighted.multiply(1.0 / total[:, None]))
