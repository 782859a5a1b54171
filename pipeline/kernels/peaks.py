"""Where a field on a surface has its maxima, between the vertices, and how sharp they are."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from pipeline.core.mesh import FloatArray, IndexArray, Mesh
from pipeline.kernels import topology

MIN_REACH_EDGES = 2.0
_MIN_POINTS = 8  # for a fit of six coefficients
_SAME_SIDE = 0.2  # cosine of normals: the other side of a thin wall is near, but another place
_MAX_STEP = 0.7  # of the reach: a maximum of the fit beyond it is extrapolated


@dataclass(frozen=True, slots=True)
class Peaks:
    """position_mm : (k, 3); value : (k,) of the field there; sharpness : (k,) field unit a mm^2, how fast it
    falls in the direction where it falls least, - second derivative; <= 0 on a ridge or where nothing could
    be fitted
    """

    position_mm: FloatArray
    value: FloatArray
    sharpness: FloatArray


def located(mesh: Mesh, field: FloatArray, vertices: IndexArray, reach_mm: float) -> Peaks:
    """The maximum of a quadric fitted to `field` (n,) around each of `vertices` (k,), weights exp(-2 (d /
    reach)^2).

    reach_mm : at least two mean edges are used, so that there is something to fit. Where the fit has no
    maximum in reach, the vertex itself. Turning or scaling the mesh moves the answers with it.
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
    for k, (vertex, found) in enumerate(zip(vertices, near, strict=True)):
        members = np.array(found)[normals[found] @ normals[vertex] > _SAME_SIDE]
        if len(members) < _MIN_POINTS:
            continue
        away = mesh.vertices[members] - mesh.vertices[vertex]
        across, along = _tangents(normals[vertex], away)
        x, y, z = away @ across / reach_mm, away @ along / reach_mm, away @ normals[vertex]
        weight = np.exp(-((x**2 + y**2) + (z / reach_mm) ** 2))
        basis = _quadric(x, y)
        fitted = np.linalg.lstsq(
            basis * weight[:, None], np.column_stack([field[members], z]) * weight[:, None]
        )[0]
        f, height = fitted.T
        hessian = np.array([[2 * f[3], f[4]], [f[4], 2 * f[5]]])
        bends = np.linalg.eigvalsh(hessian)
        sharpness[k] = -bends[1] / reach_mm**2
        if bends[1] >= 0:
            continue
        step = -np.linalg.solve(hessian, f[1:3])
        step *= min(1.0, _MAX_STEP / max(float(np.linalg.norm(step)), 1e-12))
        at = _quadric(step[:1], step[1:])[0]
        positions[k] += reach_mm * (step[0] * across + step[1] * along) + float(at @ height) * normals[vertex]
        values[k] = at @ f
    return Peaks(positions, values, sharpness)


def _quadric(x: FloatArray, y: FloatArray) -> FloatArray:
    """(k, 6) 1, x, y, x^2, xy, y^2"""
    return np.column_stack([np.ones_like(x), x, y, x * x, x * y, y * y])


def _tangents(normal: FloatArray, away: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Two unit vectors across `normal`, the first towards the farthest neighbour, so that they turn with the
    mesh.
    """
    flat = away - np.outer(away @ normal, normal)
    across = flat[int(np.round((flat**2).sum(axis=1) / max(float((flat**2).sum()), 1e-300), 9).argmax())]
    across = across / max(float(np.linalg.norm(across)), 1e-300)
    return across, np.cross(normal, across)
