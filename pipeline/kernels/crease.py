"""Creases and bumps at a physical scale: a metric that makes valleys long to cross, and a density that is
high on bumps.

Both use the signed height of each vertex over a smoothed copy of the surface, in mm. The copy is the surface
diffused along itself to a radius r (`kernels/diffusion.py`). The height is positive on bumps, negative in
valleys and grooves up to about r wide.

The metric *lifts* the surface: phi becomes one more coordinate, l'^2 = l^2 + (beta (phi_i - phi_j))^2. Three
points of a Euclidean space always form a valid triangle, so exact polyhedral geodesics apply to it. A path
across a valley becomes longer by about 2 beta times the depth of the valley; a path along its floor keeps its
length.
"""

import numpy as np

from pipeline.core.mesh import FloatArray, IntArray, Mesh
from pipeline.kernels.diffusion import diffused

#: Limit of the exponent of `convexity_weights`, no unit; keeps exp inside the range of float64. Chosen by
#: hand, not fitted.
_MAX_EXPONENT = 60.0


def height_mm(mesh: Mesh, radius_mm: float) -> FloatArray:
    """(n,) mm: signed height over the surface diffused to `radius_mm`, along the vertex normal; + on bumps.

    For small radii it is radius^2 / 4 times twice the mean curvature, smoothed.
    """
    # Relative to the mean: coordinates far from the origin would lose digits in the solve.
    positions = mesh.vertices - mesh.vertices.mean(axis=0)
    offset = positions - diffused(mesh, positions, radius_mm)
    return np.asarray(np.einsum("nd,nd->n", offset, mesh.vertex_normals()), dtype=np.float64)


def concavity(mesh: Mesh, radius_mm: float) -> FloatArray:
    """(n,) phi, mm: depth of the vertex below the surface diffused to `radius_mm`; negative on ridges."""
    return -height_mm(mesh, radius_mm)


def lifted_lengths(vertices: FloatArray, faces: IntArray, phi: FloatArray, beta: float) -> FloatArray:
    """(m, 3) mm: length of the edge opposite each corner on the surface lifted by `beta * phi`.

    vertices : (n, 3) mm; faces : (m, 3); phi : (n,) mm; beta : no unit, 0 gives the surface itself. Both
    triangles of an edge get bitwise equal lengths.
    """
    first = np.minimum(faces[:, [1, 2, 0]], faces[:, [2, 0, 1]])
    second = np.maximum(faces[:, [1, 2, 0]], faces[:, [2, 0, 1]])
    along = vertices[second] - vertices[first]
    lift = beta * (phi[second] - phi[first])
    return np.asarray(np.sqrt(np.einsum("mkd,mkd->mk", along, along) + lift**2), dtype=np.float64)


def convexity_weights(mesh: Mesh, radius_mm: float, sharpness: float) -> FloatArray:
    """(n,) mm^2: the vertex area times exp(height / (sharpness * radius)).

    sharpness : no unit. The exponential turns a *difference* of heights into a *ratio* of densities: if the
    saddle beside a peak has exp(-p / sharpness) of its density, it is lower by p radii.
    """
    exponent = height_mm(mesh, radius_mm) / (sharpness * radius_mm)
    return mesh.vertex_areas_mm2() * np.exp(np.clip(exponent, -_MAX_EXPONENT, _MAX_EXPONENT))
