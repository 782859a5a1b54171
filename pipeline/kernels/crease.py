"""Creases and bumps at a physical scale: a metric in which valleys are far to cross, a density that sits
on bumps.

The scale-space of the surface itself: positions diffused along the surface to a radius r
(`kernels/diffusion.py`), and the signed height of each vertex over the surface so smoothed, in mm:
positive on bumps, negative in valleys and grooves up to about r wide.

The metric is a *lifting*: the surface with phi as one more coordinate, l'^2 = l^2 + (beta (phi_i -
phi_j))^2. Three points of a Euclidean space always span a valid triangle, so exact polyhedral geodesics
hold on it. Crossing a valley costs about 2 beta times its depth, walking along its floor nothing.
"""

import numpy as np

from pipeline.core.mesh import FloatArray, IntArray, Mesh
from pipeline.kernels.diffusion import diffused

_MAX_EXPONENT = 60.0  # heights beyond so many sharpness units weigh alike; exp stays far inside float64


def height_mm(mesh: Mesh, radius_mm: float) -> FloatArray:
    """(n,) signed height over the surface diffused to `radius_mm`, along the vertex normal; + on bumps.

    For small radii that is radius^2 / 4 times twice the mean curvature, smoothed.
    """
    # about the centre: far from the origin the solve would lose digits
    positions = mesh.vertices - mesh.vertices.mean(axis=0)
    moved = positions - diffused(mesh, positions, radius_mm)
    return np.asarray(np.einsum("nd,nd->n", moved, mesh.vertex_normals()), dtype=np.float64)


def concavity(mesh: Mesh, radius_mm: float) -> FloatArray:
    """(n,) phi, mm: how deep the vertex lies under the surface diffused to `radius_mm`; negative on
    ridges.
    """
    return -height_mm(mesh, radius_mm)


def lifted_lengths(vertices: FloatArray, faces: IntArray, phi: FloatArray, beta: float) -> FloatArray:
    """(m, 3) mm, length of the edge opposite each corner in the surface lifted by `beta * phi`.

    vertices : (n, 3) mm; faces : (m, 3); phi : (n,) mm; beta : without unit, 0 is the surface itself. Both
    triangles at an edge get the same bits.
    """
    first = np.minimum(faces[:, [1, 2, 0]], faces[:, [2, 0, 1]])
    second = np.maximum(faces[:, [1, 2, 0]], faces[:, [2, 0, 1]])
    along = vertices[second] - vertices[first]
    lift = beta * (phi[second] - phi[first])
    return np.asarray(np.sqrt(np.einsum("mkd,mkd->mk", along, along) + lift**2), dtype=np.float64)


def convexity_weights(mesh: Mesh, radius_mm: float, sharpness: float) -> FloatArray:
    """(n,) mm^2: the vertex' area times exp(height / (sharpness * radius)).

    Exponential, so that a *ratio* of densities is a *difference* of heights: a peak whose saddle has the
    share exp(-p / sharpness) of its density stands p radii of height above it, whatever the heights are.
    """
    exponent = height_mm(mesh, radius_mm) / (sharpness * radius_mm)
    return mesh.vertex_areas_mm2() * np.exp(np.clip(exponent, -_MAX_EXPONENT, _MAX_EXPONENT))
