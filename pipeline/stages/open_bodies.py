"""What of bodies that are nearly closed lies deep within others: no surface that anybody measures.

A union needs closed bodies (`stages.bodies`). Of a body with small holes it is still certain what is within:
there the winding number (Jacobson, Kavan, Sorkine-Hornung, "Robust inside-outside segmentation using
generalized winding numbers", 2013) is that of the body with its holes covered, but for the share of the view
that the holes take up. So the holes are covered for this test only, and triangles that lie wholly within,
deeper than a wall is tessellated, are left out. Triangles that cross the surface stay.
"""

from dataclasses import dataclass

import numpy as np

from pipeline.core.mesh import BoolArray, FloatArray, IntArray, Mesh
from pipeline.kernels import topology
from pipeline.kernels.nesting import alone, boxes
from pipeline.kernels.surface import Surface

#: Max area of the holes of a body, at most that of circles of their length, over the area of the body. Chosen
#: by hand: a cup is not nearly closed, an export with cracks is.
MAX_HOLE_SHARE = 0.01
#: Depth over the diagonal from which on a triangle is within: the chord error of a CAD export, as for thin
#: voids (`stages.bodies`). Chosen by hand.
MIN_DEPTH_SHARE = 1e-3
#: Triangles of a piece that bounds a volume with a hole in it. Derived: a tetrahedron without a side.
MIN_FACES = 3


@dataclass(frozen=True, slots=True, eq=False)
class _Body:
    """faces : numbers of its triangles; covered : with its holes covered; is_closed : it has none"""

    faces: IntArray
    covered: Mesh
    is_closed: bool


def within_others(vertices: FloatArray, faces: IntArray, edges: topology.Edges) -> BoolArray:
    """(m,) triangles of outward bodies that lie deep within another, where one of the two has small holes.
    What is not nearly closed, or looks inwards as a cavity does, is neither within nor around anything.

    edges : of the faces
    """
    inside = np.zeros(len(faces), dtype=np.bool_)
    if (edges.count != 1).all():
        return inside
    component = topology.vertex_components(faces, len(vertices))[faces[:, 0]]
    _, piece = np.unique(component, return_inverse=True)  # without those of vertices that no face uses
    n_pieces = int(piece.max()) + 1
    if n_pieces < 2:
        return inside
    order = np.argsort(piece, kind="stable").astype(np.int32)
    ends = np.cumsum(np.bincount(piece, minlength=n_pieces))
    pieces = [rows for rows in np.split(order, ends[:-1]) if len(rows) >= MIN_FACES]
    bodies = [body for rows in pieces if (body := _body(vertices, faces, rows)) is not None]
    low_of = np.array([body.covered.vertices.min(axis=0) for body in bodies]).reshape(-1, 3)
    high_of = np.array([body.covered.vertices.max(axis=0) for body in bodies]).reshape(-1, 3)
    low, high = boxes(vertices, faces, piece, n_pieces)
    depth_mm = MIN_DEPTH_SHARE * float(np.linalg.norm(high.max(axis=0) - low.min(axis=0)))
    for number, outer in enumerate(bodies):
        low_mm, high_mm = low_of[number] + depth_mm, high_of[number] - depth_mm
        surface: Surface | None = None
        meets = (low_of < high_mm).all(axis=1) & (high_of > low_mm).all(axis=1)
        for inner in (bodies[at] for at in np.flatnonzero(meets) if at != number):
            if inner.is_closed and outer.is_closed:
                continue
            corners = vertices[faces[inner.faces]]
            near = ((corners > low_mm) & (corners < high_mm)).all(axis=(1, 2))
            if near.any():
                surface = surface or Surface(outer.covered)
                inside[inner.faces[near]] |= _deep(surface, corners[near], depth_mm)
    return inside


def _deep(surface: Surface, corners: FloatArray, depth_mm: float) -> BoolArray:
    """(k,) whether triangles (k, 3, 3) lie behind the surface with their corners and their middle."""
    points = np.concatenate([corners, corners.mean(axis=1, keepdims=True)], axis=1).reshape(-1, 3)
    depth = -surface.signed_distance(points, surface.closest(points))
    return np.asarray((depth > depth_mm).reshape(-1, 4).all(axis=1), dtype=np.bool_)


def _body(vertices: FloatArray, faces: IntArray, rows: IntArray) -> _Body | None:
    """None where the piece is not nearly closed, or has more than two triangles at an edge, or looks
    inwards.
    """
    points, local = alone(vertices, faces[rows])
    edges = topology.edges(local)
    if (edges.count > 2).any() or not topology.is_coherent(local):
        return None
    mesh = Mesh(points, local)
    border = (edges.count == 1)[edges.of_face]
    is_closed = not border.any()
    if not is_closed:
        covered = _covered(mesh, border)
        if covered is None:
            return None
        mesh = covered
    a, b, c = (mesh.vertices[mesh.faces[:, k]] - mesh.vertices.mean(axis=0) for k in range(3))
    if float(np.einsum("ij,ij->i", a, np.cross(b, c)).sum()) <= 0:
        return None
    return _Body(rows, mesh, is_closed)


def _covered(mesh: Mesh, border: BoolArray) -> Mesh | None:
    """The mesh with a fan from the middle of each hole to its border, None where the holes are not small.

    border : (m, 3) whether the edge opposite each corner is on a border
    """
    row, corner = np.nonzero(border)
    start, end = mesh.faces[row, (corner + 1) % 3], mesh.faces[row, (corner + 2) % 3]
    hole = topology.vertex_components(np.stack([start, end, end], axis=1), len(mesh.vertices))[start]
    _, of_edge = np.unique(hole, return_inverse=True)
    length_mm = np.bincount(of_edge, np.linalg.norm(mesh.vertices[end] - mesh.vertices[start], axis=1))
    if (length_mm**2).sum() / (4 * np.pi) > MAX_HOLE_SHARE * float(mesh.face_areas_mm2().sum()):
        return None
    total = np.stack([np.bincount(of_edge, mesh.vertices[start, k]) for k in range(3)], axis=1)
    middle = total / np.bincount(of_edge)[:, None]
    fan = np.stack([end, start, len(mesh.vertices) + of_edge], axis=1).astype(np.int32)
    return Mesh(np.concatenate([mesh.vertices, middle]), np.concatenate([mesh.faces, fan]))
