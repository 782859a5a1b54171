"""Connectivity of a triangle mesh: edges, borders, connected pieces, orientation."""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_matrix, csgraph

from pipeline.core.mesh import BoolArray, IndexArray, IntArray
from pipeline.kernels.native import core


@dataclass(frozen=True, slots=True)
class Edges:
    """Undirected edges, sorted by their vertices.

    ends : (k, 2) int64, ends[:, 0] < ends[:, 1]; of_face : (m, 3) int64, index of the edge opposite each
    corner; count : (k,) int64, triangles at the edge (1 = border, > 2 = non-manifold)
    """

    ends: IndexArray
    of_face: IndexArray
    count: IndexArray


def edges(faces: IntArray) -> Edges:
    """The edges of `faces` (m, 3)."""
    faces = np.ascontiguousarray(faces, dtype=np.int32)
    return Edges(*core.edges(faces, int(faces.max(initial=-1)) + 1))


def border_vertices(faces: IntArray, n: int) -> BoolArray:
    """(n,) whether the vertex lies on an edge with one triangle. faces : (m, 3); n : number of vertices"""
    mesh_edges = edges(faces)
    on_border = np.zeros(n, dtype=np.bool_)
    on_border[mesh_edges.ends[mesh_edges.count == 1].ravel()] = True
    return on_border


def vertex_components(faces: IntArray, n: int) -> IntArray:
    """(n,) int32: connected piece of each vertex, numbered by first vertex; an isolated vertex is a piece."""
    rows = faces[:, [0, 1]].T.ravel()
    columns = faces[:, [1, 2]].T.ravel()
    graph = coo_matrix((np.ones(len(rows), dtype=np.int8), (rows, columns)), shape=(n, n))
    return np.asarray(csgraph.connected_components(graph, directed=False)[1], dtype=np.int32)


def is_coherent(faces: IntArray) -> bool:
    """Whether no directed edge occurs twice, so neighbouring `faces` (m, 3) have the same orientation."""
    directed = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]).astype(np.int64)
    keys = np.sort(directed[:, 0] * (int(directed.max(initial=0)) + 1) + directed[:, 1])
    return not bool((keys[1:] == keys[:-1]).any())
