"""Maxima of a scalar field on a surface, located between vertices by a quadric fit, and their sharpness."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from pipeline.core.mesh import FloatArray, IndexArray, Mesh
from pipeline.kernels import topology

#: Smallest radius of the fit, in mean edge lengths. Chosen by hand, not fitted.
MIN_REACH_EDGES = 2.0
#: Fewest points of a fit with six coefficients, and of one with four, which takes the quadric to be round: on
#: the top of a pin there are no more. Chosen by hand, not fitted.
_MIN_POINTS, _MIN_POINTS_ROUND = 8, 5
#: Smallest cosine between the normals of a point and the vertex; excludes the other side of a thin wall.
#: Chosen by hand, not fitted.
_MIN_COSINE = 0.2
#: Largest shift of a maximum, as a share of the radius; a larger one would be extrapolated. Chosen by hand,
#: not fitted.
_MAX_STEP = 0.7
#: Smallest length of a shift, as a share of the radius; avoids a division by 0.
_MIN_STEP = 1e-12
#: Decimals to which the squared shares of the tangent offsets are rounded: equal offsets tie, and the first
#: one wins. Derived from rounding, with reserve.
_TIE_DECIMALS = 9
#: Smallest length, avoids a division by 0.
_TINY = 1e-300
#: The six coefficients of `_quadric` from those that are fitted: all, or x^2 and y^2 alike and no xy.
_FULL = np.eye(6)
_ROUND = np.array(
    [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1], [0, 0, 0, 0], [0, 0, 0, 1]], dtype=np.float64
)


@dataclass(frozen=True, slots=True)
class Peaks:
    """Located maxima.

    position_mm : (k, 3); value : (k,) field at the position; sharpness : (k,) field unit per mm^2, the
    negative second derivative in the direction where the field decreases most slowly; <= 0 on a ridge or
    without a fit
    """

    position_mm: FloatArray
    value: FloatArray
    sharpness: FloatArray


def located(mesh: Mesh, field: FloatArray, vertices: IndexArray, reach_mm: float) -> Peaks:
    """Maximum of a quadric fitted to `field` (n,) around each of `vertices` (k,).

    reach_mm : radius of the fit, at least `MIN_REACH_EDGES` mean edges. The residual at distance d is
    multiplied by exp(-(d / reach)^2). If the fit has no maximum, the result is the vertex itself. The result
    follows a rotation or scaling of the mesh.
    """
    normals = mesh.vertex_normals()
    ends = topology.edges(mesh.faces).ends
    edges = np.linalg.norm(mesh.vertices[ends[:, 1]] - mesh.vertices[ends[:, 0]], axis=1)
    reach_mm = max(reach_mm, MIN_REACH_EDGES * float(edges.mean()) if len(edges) else reach_mm)
    near = cKDTree(mesh.vertices).query_ball_point(mesh.vertices[vertices], reach_mm, return_sorted=True)
    positions, values, sharpness = (
        mesh.vertices[vertices].copy(),
        field[vertices].copy(),
        np.zeros(len(vertices)),
    )
    for k, (vertex, neighbours) in enumerate(zip(vertices, near, strict=True)):
        members = np.array(neighbours)[normals[neighbours] @ normals[vertex] > _MIN_COSINE]
        if len(members) < _MIN_POINTS_ROUND:
            continue
        offset = mesh.vertices[members] - mesh.vertices[vertex]
        t1, t2 = _tangents(normals[vertex], offset)
        x, y, z = offset @ t1 / reach_mm, offset @ t2 / reach_mm, offset @ normals[vertex]
        weight = np.exp(-((x**2 + y**2) + (z / reach_mm) ** 2))
        terms = _FULL if len(members) >= _MIN_POINTS else _ROUND
        basis = _quadric(x, y) @ terms
        fitted = np.linalg.lstsq(
            basis * weight[:, None], np.column_stack([field[members], z]) * weight[:, None]
        )[0]
        f, height = (terms @ fitted).T
        hessian = np.array([[2 * f[3], f[4]], [f[4], 2 * f[5]]])
        eigenvalues = np.linalg.eigvalsh(hessian)
        sharpness[k] = -eigenvalues[1] / reach_mm**2
        if eigenvalues[1] >= 0:
            continue
        step = -np.linalg.solve(hessian, f[1:3])
        step *= min(1.0, _MAX_STEP / max(float(np.linalg.norm(step)), _MIN_STEP))
        at = _quadric(step[:1], step[1:])[0]
        positions[k] += reach_mm * (step[0] * t1 + step[1] * t2) + float(at @ height) * normals[vertex]
        values[k] = at @ f
    return Peaks(positions, values, sharpness)


def _quadric(x: FloatArray, y: FloatArray) -> FloatArray:
    """(k, 6) basis functions 1, x, y, x^2, xy, y^2 at (k,) x and y."""
    return np.column_stack([np.ones_like(x), x, y, x * x, x * y, y * y])


def _tangents(normal: FloatArray, offset: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Two orthonormal tangents (3,) of `normal` (3,); the first points to the farthest of `offset` (k, 3).

    They rotate with the mesh.
    """
    flat = offset - np.outer(offset @ normal, normal)
    share = (flat**2).sum(axis=1) / max(float((flat**2).sum()), _TINY)
    t1 = flat[int(np.round(share, _TIE_DECIMALS).argmax())]
    t1 = t1 / max(float(np.linalg.norm(t1)), _TINY)
    return t1, np.cross(normal, t1)
