"""Removes triangles without area from a closed mesh, which stays closed.

Dropping one would open the mesh. Where two of its corners almost coincide they are merged; else one of its
corners lies on the opposite edge, and that edge is flipped.
"""

import numpy as np
from scipy.sparse import coo_matrix, csgraph

from pipeline.core.mesh import BoolArray, FloatArray, IndexArray, IntArray
from pipeline.kernels import topology

#: Passes over the mesh; a flip may give another triangle without area. Chosen by hand: three are enough for
#: seams of unions.
PASSES = 8


def without_flat(
    vertices: FloatArray, faces: IntArray, area_share: float, short_mm: float
) -> tuple[FloatArray, IntArray]:
    """Vertices (n, 3) and faces (m, 3) of the same surface without triangles without area.

    area_share : of its longest edge squared, that a triangle without area has at most; short_mm : corners
    nearer than that are merged
    """
    faces = _without_needles(vertices, faces, area_share, short_mm)
    faces = without_caps(vertices, faces, area_share)
    used, index = np.unique(faces, return_inverse=True)
    return vertices[used], index.reshape(-1, 3).astype(np.int32)


def _without_needles(vertices: FloatArray, faces: IntArray, area_share: float, short_mm: float) -> IntArray:
    """Faces with the ends of the shortest edge of each flat triangle merged, where it is short."""
    for _ in range(PASSES):
        flat, _ = _flat(vertices, faces, area_share)
        corners = vertices[faces[flat]]
        lengths = np.linalg.norm(np.roll(corners, -1, axis=1) - np.roll(corners, -2, axis=1), axis=2)
        shortest = lengths.argmin(axis=1)
        rows = np.flatnonzero(flat)[lengths.min(axis=1, initial=np.inf) < short_mm]
        at = shortest[lengths.min(axis=1, initial=np.inf) < short_mm]
        if len(rows) == 0:
            break
        ends = np.stack([faces[rows, (at + 1) % 3], faces[rows, (at + 2) % 3]], axis=1)
        faces = _merged(faces, ends, len(vertices))
    return faces


def _merged(faces: IntArray, ends: IndexArray | IntArray, n: int) -> IntArray:
    """Faces with the ends (k, 2) of edges merged, without those that have a vertex twice then, and without
    pairs that cover each other.
    """
    graph = coo_matrix((np.ones(len(ends), dtype=np.int8), (ends[:, 0], ends[:, 1])), shape=(n, n))
    group = csgraph.connected_components(graph, directed=False)[1]
    _, first = np.unique(group, return_index=True)
    merged = first[group][faces].astype(np.int32)
    merged = merged[(merged != np.roll(merged, 1, axis=1)).all(axis=1)]
    _, same = np.unique(np.sort(merged, axis=1), axis=0, return_inverse=True)
    # the sign of the permutation that sorts the corners: which way round they go
    step = np.sign(np.roll(merged, -1, axis=1).astype(np.int64) - merged).prod(axis=1)
    same = same.ravel()
    count = np.bincount(same)
    balance = np.bincount(same, weights=step)
    covered: BoolArray = (count[same] == 2) & (balance[same] == 0)
    return np.asarray(merged[~covered], dtype=np.int32)


def without_caps(vertices: FloatArray, faces: IntArray, area_share: float) -> IntArray:
    """Faces (m, 3) of the same surface, each edge opposite a corner that lies on it flipped.

    area_share : of its longest edge squared, that a triangle without area has at most. Triangles whose
    longest edge has not two triangles stay.
    """
    faces = faces.copy()
    for _ in range(PASSES):
        flat, longest = _flat(vertices, faces, area_share)
        if not flat.any():
            break
        edges = topology.edges(faces)
        changed = set[int]()
        by_edge = np.argsort(edges.of_face.ravel(), kind="stable")
        begin = np.cumsum(edges.count) - edges.count
        for face in np.flatnonzero(flat):
            corner = int(longest[face])
            edge = edges.of_face[face, corner]
            if edges.count[edge] != 2:
                continue
            slots = by_edge[begin[edge] : begin[edge] + 2]
            other, across = divmod(int(slots[slots // 3 != face][0]), 3)
            if {int(face), other} & changed:
                continue
            tip, left, right = (faces[face, (corner + k) % 3] for k in range(3))
            far = faces[other, across]
            if tip == far:
                continue
            faces[face], faces[other] = (tip, left, far), (tip, far, right)
            changed |= {int(face), other}
        if not changed:
            break
    return faces


def _flat(vertices: FloatArray, faces: IntArray, area_share: float) -> tuple[BoolArray, IntArray]:
    """(m,) triangles without area, and the corner (m,) opposite the longest edge of each."""
    corners = vertices[faces]
    lengths = np.linalg.norm(np.roll(corners, -1, axis=1) - np.roll(corners, -2, axis=1), axis=2)
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2
    longest = lengths.argmax(axis=1).astype(np.int32)
    return np.asarray(area <= area_share * lengths.max(axis=1) ** 2), longest
