"""The closed shells of a set of triangles, also where several shells share edges.

At an edge with more than two triangles, those that bound the same material belong together: around the edge,
the triangle where material begins pairs with the next where it ends (the order of radial edges of Weiler,
"Edge-based data structures for solid modeling in curved-surface environments", 1985).
"""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_matrix, csgraph

from pipeline.core.mesh import BoolArray, FloatArray, IndexArray, IntArray
from pipeline.kernels import topology

#: Triangles at an edge that are nearer in angle than this (rad) are taken as coincident. Derived: the angle
#: that rounding of single precision leaves, with a margin.
SAME_ANGLE = 1e-5


@dataclass(frozen=True, slots=True)
class Shells:
    """of_face : (m,) int64 shell of each triangle, numbered by first triangle, -1 where its connected piece
    is not closed; shared_edges : edges of closed pieces with more than two triangles; halves : (h, 4) int64,
    triangle and corner opposite to the edge, of the two triangles that belong together at each edge
    """

    of_face: IndexArray
    shared_edges: int
    halves: IndexArray

    @property
    def count(self) -> int:
        return int(self.of_face.max(initial=-1)) + 1


def closed_pieces(faces: IntArray, n: int, edges: topology.Edges) -> IndexArray:
    """(m,) connected piece of each triangle where each of its edges is used as often in both directions, so
    that the piece bounds a volume; -1 of the others.
    """
    balance = np.bincount(edges.of_face.ravel(), _signs(faces).ravel(), minlength=len(edges.count))
    piece = topology.vertex_components(faces, n)
    is_open = np.zeros(int(piece.max(initial=-1)) + 1, dtype=np.bool_)
    is_open[piece[edges.ends[balance != 0, 0]]] = True
    of_face = piece[faces[:, 0]].astype(np.int64)
    return np.where(is_open[of_face], -1, of_face)


def shells(
    vertices: FloatArray,
    faces: IntArray,
    edges: topology.Edges,
    closed: BoolArray,
    body: IntArray | None,
) -> Shells:
    """The shells of the closed pieces. No triangle may have a vertex twice.

    closed : (m,) triangles of `closed_pieces`; body : (m,) of each triangle as the file has them, or None;
    triangles of one body are paired first
    """
    of_face = np.full(len(faces), -1, dtype=np.int64)
    simple, shared = _slots(faces, edges, closed)
    joined = _joined(len(faces), simple[:, [0, 2]])
    if shared:
        group = joined if body is None else joined + (int(joined.max()) + 1) * body
        pairs = [_paired(vertices, faces, slots, group, body) for slots in shared]
        halves = np.concatenate([simple, *pairs])
        joined = _joined(len(faces), halves[:, [0, 2]])
    else:
        halves = simple
    of_closed = joined[closed]
    if (of_closed == of_closed[0]).all():
        of_face[closed] = 0
    else:
        _, first, inverse = np.unique(of_closed, return_index=True, return_inverse=True)
        of_face[closed] = np.argsort(np.argsort(first))[inverse]
    return Shells(of_face, len(shared), halves)


def split_vertices(vertices: FloatArray, faces: IntArray, found: Shells) -> tuple[IndexArray, IntArray]:
    """Index (k,) of the vertex that each new one copies, and faces (m, 3) over the new ones, where triangles
    share a vertex only as far as they belong together at an edge. Open pieces keep their vertices.
    """
    halves, m = found.halves, len(faces)
    left, right = halves[:, :2], halves[:, 2:]
    # the end of an edge is the next corner of one triangle and the last but one of the other
    one = 3 * left[:, 0] + (left[:, 1] + 1) % 3, 3 * right[:, 0] + (right[:, 1] + 2) % 3
    two = 3 * left[:, 0] + (left[:, 1] + 2) % 3, 3 * right[:, 0] + (right[:, 1] + 1) % 3
    fan = _joined(3 * m, np.stack([np.concatenate([one[0], two[0]]), np.concatenate([one[1], two[1]])], 1))
    is_open = np.repeat(found.of_face < 0, 3)
    flat = faces.ravel().astype(np.int64)
    key = np.where(is_open, flat, len(vertices) + fan)
    used, first, corner = np.unique(key, return_index=True, return_inverse=True)
    source = flat[first]
    order = np.argsort(source, kind="stable")
    rank = np.empty(len(used), dtype=np.int64)
    rank[order] = np.arange(len(used))
    return source[order], rank[corner].reshape(-1, 3).astype(np.int32)


def signed_volumes(vertices: FloatArray, faces: IntArray, shell: IndexArray, n_shells: int) -> FloatArray:
    """(s,) volume of each shell, positive where its normals point outwards. shell : (m,)"""
    a, b, c = (vertices[faces[:, k]] - vertices.mean(axis=0) for k in range(3))
    six = np.einsum("ij,ij->i", a, np.cross(b, c))
    return np.asarray(np.bincount(shell, weights=six, minlength=n_shells) / 6.0)


def _signs(faces: IntArray) -> FloatArray:
    """(m, 3) +1 where the edge opposite the corner runs from the smaller to the larger vertex."""
    return np.where(faces[:, [1, 2, 0]] < faces[:, [2, 0, 1]], 1.0, -1.0)


def _slots(faces: IntArray, edges: topology.Edges, closed: BoolArray) -> tuple[IndexArray, list[IndexArray]]:
    """Pairs (h, 4) of triangle and corner at edges with two triangles, and for each other edge its (k, 3)
    triangles, corners and directions, ascending.
    """
    slots = np.flatnonzero(np.repeat(closed, 3))  # 3 * triangle + corner
    edge = edges.of_face[closed].ravel()
    first, last = np.zeros(len(edges.count), dtype=np.int64), np.zeros(len(edges.count), dtype=np.int64)
    last[edge] = slots  # of equal indices, numpy keeps the last value
    first[edge[::-1]] = slots[::-1]
    two = np.unique(edge) if len(edge) < edges.of_face.size else np.arange(len(edges.count))
    two = two[edges.count[two] == 2]
    simple = np.stack([first[two] // 3, first[two] % 3, last[two] // 3, last[two] % 3], axis=1)
    many = edges.count[edge] > 2
    if not many.any():
        return simple, []
    slots, edge = slots[many], edge[many]
    order = np.argsort(edge, kind="stable")
    face, corner = slots[order] // 3, slots[order] % 3
    sign = _signs(faces[face])[np.arange(len(face)), corner].astype(np.int64)
    starts = np.flatnonzero(np.diff(edge[order], prepend=-1))
    return simple, np.split(np.stack([face, corner, sign], axis=1), starts[1:])


def _paired(
    vertices: FloatArray, faces: IntArray, slots: IndexArray, group: IndexArray, body: IntArray | None
) -> IndexArray:
    """(h, 4) pairs of the triangles at one edge: within the connected piece where that is balanced, then
    within the body, then all.
    """
    left = slots
    pairs: list[IndexArray] = []
    for label in (group, body):
        if label is None:
            continue
        for value in np.unique(label[left[:, 0]]):
            mine = label[left[:, 0]] == value
            if left[mine, 2].sum() == 0:
                pairs.append(_by_angle(vertices, faces, left[mine]))
                left = left[~mine]
    if len(left):
        pairs.append(_by_angle(vertices, faces, left))
    return np.concatenate(pairs)


def _by_angle(vertices: FloatArray, faces: IntArray, slots: IndexArray) -> IndexArray:
    """(k / 2, 4): each triangle where material begins, around the edge, and the next where it ends."""
    face, corner, sign = slots.T
    if len(slots) == 2:
        return np.concatenate([slots[0, :2], slots[1, :2]])[None]
    ends = np.stack([faces[face[0], (corner[0] + 1) % 3], faces[face[0], (corner[0] + 2) % 3]])
    low, high = vertices[ends.min()], vertices[ends.max()]
    axis = (high - low) / np.linalg.norm(high - low)
    away = vertices[faces[face, corner]] - low
    away = away - (away @ axis)[:, None] * axis
    first = away[0] / max(float(np.linalg.norm(away[0])), np.finfo(np.float64).tiny)
    angle = np.arctan2(away @ np.cross(axis, first), away @ first) % (2.0 * np.pi)
    angle[angle > 2.0 * np.pi - SAME_ANGLE] = 0.0
    order = np.argsort(angle, kind="stable")
    step = np.cumsum(np.diff(angle[order], prepend=0.0) > SAME_ANGLE)
    # +1 runs along the edge, its normal towards larger angles: material ends there
    order = order[np.lexsort((face[order], -sign[order], step))]
    depth = np.cumsum(-sign[order])
    order = np.roll(order, -(int(np.argmin(depth)) + 1))  # from where no material is around
    begins = [at for at in order if sign[at] < 0]
    ends_at = [at for at in order if sign[at] > 0]
    return np.array(
        [[*slots[a, :2], *slots[b, :2]] for a, b in zip(begins, ends_at, strict=True)], dtype=np.int64
    )


def _joined(n: int, pairs: IndexArray) -> IndexArray:
    """(n,) connected component of each of n things that `pairs` (k, 2) join."""
    ones = np.ones(len(pairs), dtype=np.int8)
    graph = coo_matrix((ones, (pairs[:, 0], pairs[:, 1])), shape=(n, n))
    return np.asarray(csgraph.connected_components(graph, directed=False)[1], dtype=np.int64)
