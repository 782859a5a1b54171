"""Which shells lie within which, and which may meet: by their boxes first, then by distance."""

import numpy as np
from scipy.sparse import coo_matrix, csgraph

from pipeline.core.mesh import BoolArray, FloatArray, IndexArray, IntArray, Mesh
from pipeline.kernels.shells import Shells
from pipeline.kernels.surface import Surface


def smallest_around(vertices: FloatArray, faces: IntArray, found: Shells, volume: FloatArray) -> IndexArray:
    """(s,) the shell of least volume that each shell lies within, -1 if there is none."""
    closed = np.flatnonzero(found.of_face >= 0)
    low, high = boxes(vertices, faces[closed], found.of_face[closed], found.count)
    _, first = np.unique(found.of_face[closed], return_index=True)
    point = vertices[faces[closed[first]]].mean(axis=1)
    size = np.abs(volume)
    around = np.full(found.count, -1)
    for outer in np.argsort(size, kind="stable"):
        inner = (low[outer] <= low).all(axis=1) & (high[outer] >= high).all(axis=1)
        inner = np.flatnonzero(inner & (size < size[outer]) & (around < 0))
        if len(inner):
            surface = Surface(Mesh(*alone(vertices, faces[found.of_face == outer])))
            closest = surface.closest(point[inner])
            depth = surface.signed_distance(point[inner], closest) * np.sign(volume[outer])
            around[inner[depth < 0]] = outer
    return around


def deep_within(mesh: Mesh, found: Shells, parent: IndexArray) -> IndexArray:
    """Bodies that lie wholly within the material of another, ascending, as is told without a union: the
    middle of such a body is farther from the other's surface than from any point of its own.

    parent : (s,) body of each shell
    """
    closed = np.flatnonzero(found.of_face >= 0)
    bodies, body = np.unique(parent[found.of_face[closed]], return_inverse=True)
    low, high = boxes(mesh.vertices, mesh.faces[closed], body, len(bodies))
    middle, reach_mm = (low + high) / 2, np.linalg.norm(high - low, axis=1) / 2
    deep = np.zeros(len(bodies), dtype=np.bool_)
    for outer in np.argsort(-reach_mm, kind="stable"):
        within = (low >= low[outer]).all(axis=1) & (high <= high[outer]).all(axis=1)
        inner = np.flatnonzero(within & ~deep & (reach_mm < reach_mm[outer]))
        if len(inner) and not deep[outer]:
            surface = Surface(Mesh(*alone(mesh.vertices, mesh.faces[closed[body == outer]])))
            closest = surface.closest(middle[inner])
            depth_mm = -surface.signed_distance(middle[inner], closest)
            deep[inner[depth_mm > reach_mm[inner]]] = True
    return bodies[deep]


def boxes(
    vertices: FloatArray, faces: IntArray, shell: IndexArray, n_shells: int
) -> tuple[FloatArray, FloatArray]:
    """Lower and upper corner (s, 3) of each shell."""
    low, high = np.full((n_shells, 3), np.inf), np.full((n_shells, 3), -np.inf)
    for k in range(3):
        np.minimum.at(low, shell, vertices[faces[:, k]])
        np.maximum.at(high, shell, vertices[faces[:, k]])
    return low, high


def alone(vertices: FloatArray, faces: IntArray) -> tuple[FloatArray, IntArray]:
    """Faces over the vertices that they use, ascending."""
    used, index = np.unique(faces, return_inverse=True)
    return vertices[used], index.reshape(-1, 3).astype(np.int32)


def meeting(low: FloatArray, high: FloatArray) -> list[IndexArray]:
    """Groups of two or more boxes that meet, ascending. low, high : (s, 3) corners"""
    order = np.argsort(low[:, 0], kind="stable")
    low, high = low[order], high[order]
    pairs = [np.zeros((0, 2), dtype=np.int64)]
    for at in range(len(order) - 1):
        last = int(np.searchsorted(low[:, 0], high[at, 0], side="right"))
        near = np.arange(at + 1, max(last, at + 1))
        meet = (low[near] <= high[at]).all(axis=1) & (high[near] >= low[at]).all(axis=1)
        pairs.append(np.stack([np.full(int(meet.sum()), at), near[meet]], axis=1))
    joined = np.concatenate(pairs)
    ones = np.ones(len(joined), dtype=np.int8)
    graph = coo_matrix((ones, (joined[:, 0], joined[:, 1])), shape=(len(order), len(order)))
    group = csgraph.connected_components(graph, directed=False)[1]
    members = [np.sort(order[group == each]) for each in np.flatnonzero(np.bincount(group) > 1)]
    return sorted(members, key=lambda each: int(each[0]))


def meets_any(low: FloatArray, high: FloatArray, other_low: FloatArray, other_high: FloatArray) -> BoolArray:
    """(s,) whether each box meets one of the others."""
    if len(low) <= len(other_low):
        found = [
            bool(((a <= other_high).all(axis=1) & (b >= other_low).all(axis=1)).any())
            for a, b in zip(low, high, strict=True)
        ]
        return np.array(found, dtype=np.bool_)
    met = np.zeros(len(low), dtype=np.bool_)
    for a, b in zip(other_low, other_high, strict=True):
        met |= (low <= b).all(axis=1) & (high >= a).all(axis=1)
    return met
