"""Triangles without area of a closed mesh, whose one corner lies on the opposite edge, by flips of that edge.

Dropping one would open the mesh: its corner would lie on the edge of the neighbour, unconnected.
"""

import numpy as np

from pipeline.core.mesh import BoolArray, FloatArray, IntArray
from pipeline.kernels import topology

#: Passes over the mesh; a flip may give another triangle without area. Chosen by hand: three are enough for
#: seams of unions.
PASSES = 8


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
