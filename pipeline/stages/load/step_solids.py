"""The solids of one product of a STEP, which Open CASCADE gives as one mesh.

It writes the faces of one shell after those of another, and triangles of a sound shell fit exactly. So a
shell ends where every edge so far has had its second triangle; two solids that touch have the edges of both.
"""

import numpy as np

from pipeline.core.mesh import FloatArray, IndexArray, IntArray
from pipeline.stages.load.contents import Body


def split_solids(body: Body) -> list[Body]:
    """One body for each solid, in the order of the file; the body itself where its triangles do not close.

    A shell with normals inwards is a cavity of the solid before it.
    """
    first, same = np.unique(body.vertices, axis=0, return_index=True, return_inverse=True)[1:]
    ends = _ends_of_shells(same.ravel()[body.faces])
    if len(ends) < 2 or ends[-1] != len(body.faces):
        return [body]
    middle = body.vertices[first].mean(axis=0)  # the volume loses digits far from the origin
    volumes = np.add.reduceat(_volumes(body.vertices - middle, body.faces), [0, *ends[:-1]])
    starts = [start for start, volume in zip([0, *ends[:-1]], volumes, strict=True) if volume > 0]
    if not starts or starts[0] != 0 or len(starts) < 2:
        return [body]
    stops = [*starts[1:], len(body.faces)]
    return [_piece(body, slice(start, stop)) for start, stop in zip(starts, stops, strict=True)]


def _ends_of_shells(faces: IndexArray) -> list[int]:
    """Numbers of triangles after which every edge was met an even number of times."""
    edges = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    triangle = np.repeat(np.arange(len(faces)), 3)
    is_edge = edges[:, 0] != edges[:, 1]
    edges, triangle = edges[is_edge], triangle[is_edge]
    _, of_edge = np.unique(edges, axis=0, return_inverse=True)
    order = np.argsort(of_edge.ravel(), kind="stable")
    grouped = of_edge.ravel()[order]
    starts = np.flatnonzero(np.r_[True, grouped[1:] != grouped[:-1]])
    rank = np.arange(len(grouped)) - np.repeat(starts, np.diff(np.r_[starts, len(grouped)]))
    opened = np.zeros(len(edges), dtype=np.int64)
    opened[order] = np.where(rank % 2 == 0, 1, -1)
    still_open = np.cumsum(np.bincount(triangle, weights=opened, minlength=len(faces)))
    return [int(end) + 1 for end in np.flatnonzero(still_open == 0)]


def _volumes(vertices: FloatArray, faces: IndexArray | IntArray) -> FloatArray:
    """(m,) signed volume of the tetrahedron of each triangle with the origin."""
    a, b, c = (vertices[faces[:, corner]] for corner in range(3))
    volumes: FloatArray = np.einsum("md,md->m", a, np.cross(b, c)) / 6.0
    return volumes


def _piece(body: Body, triangles: slice) -> Body:
    faces = body.faces[triangles]
    used, of_corner = np.unique(faces, return_inverse=True)
    brep = None if body.brep is None else body.brep.part(triangles)
    return Body(body.vertices[used], of_corner.reshape(faces.shape), body.name, brep=brep)
