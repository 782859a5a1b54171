"""Bodies that touch or overlap, as one surface: the walls between them are no surface that anybody measures.

Closed bodies are united (`kernels.solid_union`). Cavities (shells with normals inwards, within a body) stay
cavities. Bodies that do not meet, and surfaces that are not closed, stay as they are.
"""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_matrix, csgraph

from pipeline.core.mesh import BoolArray, FloatArray, IndexArray, IntArray, Mesh
from pipeline.kernels import topology
from pipeline.kernels.caps import without_flat
from pipeline.kernels.shells import Shells, closed_pieces, shells, signed_volumes, split_vertices
from pipeline.kernels.solid_union import GAP_SHARE, united
from pipeline.kernels.surface import Surface

#: Bodies meet when less than this share of their surface is left after the union. Derived: rounding.
MEETING_SHARE = 1e-6
#: A void between united bodies that is thinner than this share of the diagonal is filled: two walls that
#: touch, tessellated differently. Chosen by hand: the chord error of a CAD export.
THIN_VOID_SHARE = 1e-3
#: A triangle of less area than this share of its longest edge squared has a corner on its opposite edge.
#: Derived: above what `clean` drops, below rounding of single precision.
CAP_AREA_SHARE = 1e-10
#: Corners of such triangles are merged where they are nearer than this many gaps. Derived: two walls grow,
#: and a corner of three walls by the square root of 3 more.
SHORT_GAPS = 4.0


@dataclass(frozen=True, slots=True)
class United:
    """vertices (n, 3), faces (m, 3); old_of_new : (n,) vertex before, -1 of a new one; report : counts for
    `provenance.inputs.<mesh>.cleaning`
    """

    vertices: FloatArray
    faces: IntArray
    old_of_new: IndexArray
    report: dict[str, int | float]


def unite(
    vertices: FloatArray, faces: IntArray, edges: topology.Edges, body: IntArray | None
) -> United | None:
    """The surface without the walls between closed bodies that meet; None where that changes nothing.

    faces : none has a vertex twice; body : (m,) of each triangle as the file has them, or None
    """
    pieces = closed_pieces(faces, len(vertices), edges)
    closed = pieces >= 0
    if not closed.any():
        return None
    report = _no_report()
    report["bodies_not_united"] = _open_that_meet(vertices, faces, closed)
    found = shells(vertices, faces, edges, closed, body)
    if found.count == 1 and found.shared_edges == 0:
        apart = United(vertices, faces, np.arange(len(vertices)), report)
        return apart if report["bodies_not_united"] else None
    source = np.arange(len(vertices))
    if found.shared_edges:
        source, faces = split_vertices(vertices, faces, found)
        vertices = vertices[source]
    faces, parent, turned = _oriented(vertices, faces, found)
    mesh = Mesh(vertices, faces)
    areas = mesh.face_areas_mm2()
    kept, added = np.ones(len(faces), dtype=np.bool_), list[Mesh]()
    report["turned_faces"] = turned
    for group in _groups(vertices, faces, found, parent, GAP_SHARE * mesh.diagonal_mm):
        members = [np.isin(found.of_face, np.flatnonzero(parent == each)) for each in group]
        whole = np.logical_or.reduce(members)
        union = united([_alone(vertices, faces[mine]) for mine in members], mesh.diagonal_mm)
        if union is None:
            report["bodies_not_united"] += len(group)
            continue
        union = _proper(union, SHORT_GAPS * GAP_SHARE * mesh.diagonal_mm)
        union, n_voids = _without_thin_voids(union, THIN_VOID_SHARE * mesh.diagonal_mm)
        internal_mm2 = float(areas[whole].sum() - union.face_areas_mm2().sum())
        if internal_mm2 < MEETING_SHARE * areas[whole].sum():
            continue
        kept &= ~whole
        added.append(union)
        report["united_bodies"] += len(group)
        report["internal_area_mm2"] += internal_mm2
        report["filled_voids"] += n_voids
    if not (added or found.shared_edges or turned or report["bodies_not_united"]):
        return None
    gone = np.zeros(len(vertices), dtype=np.bool_)
    gone[faces[~kept]] = True
    gone[faces[kept]] = False
    rest = (np.cumsum(~gone) - 1)[faces[kept]]
    return _assembled(vertices[~gone], rest, source[~gone], added, report)


def _no_report() -> dict[str, int | float]:
    return {"united_bodies": 0, "internal_area_mm2": 0.0, "filled_voids": 0, "bodies_not_united": 0}


def _oriented(vertices: FloatArray, faces: IntArray, found: Shells) -> tuple[IntArray, IndexArray, int]:
    """Faces with all bodies outwards, the body (s,) of each shell, itself where it is one, and how many
    triangles were turned over.

    A shell with normals inwards is a cavity of the smallest body around it; without one, it is a body that
    is inside out, with all shells that it is the smallest around.
    """
    closed = found.of_face >= 0
    shell, n_shells = found.of_face[closed], found.count
    volume = signed_volumes(vertices, faces[closed], shell, n_shells)
    parent = np.arange(n_shells)
    if (volume >= 0).all():
        return faces, parent, 0
    around = _smallest_around(vertices, faces, found, volume)
    inside_out = np.zeros(n_shells, dtype=np.bool_)
    for each in np.argsort(-np.abs(volume), kind="stable"):  # the outer ones first
        out = int(around[each])
        if out < 0 or parent[out] != out:  # no body around, or within a cavity
            inside_out[each] = volume[each] < 0
        elif inside_out[out] or volume[each] < 0:
            inside_out[each] = bool(inside_out[out])
            if (volume[each] < 0) != inside_out[out]:
                parent[each] = out
    turn = closed & inside_out[np.maximum(found.of_face, 0)]
    return np.where(turn[:, None], faces[:, ::-1], faces).astype(np.int32), parent, int(turn.sum())


def _smallest_around(vertices: FloatArray, faces: IntArray, found: Shells, volume: FloatArray) -> IndexArray:
    """(s,) the shell of least volume that each shell lies within, -1 if there is none."""
    closed = np.flatnonzero(found.of_face >= 0)
    low, high = _boxes(vertices, faces[closed], found.of_face[closed], found.count)
    _, first = np.unique(found.of_face[closed], return_index=True)
    point = vertices[faces[closed[first]]].mean(axis=1)
    size = np.abs(volume)
    around = np.full(found.count, -1)
    for outer in np.argsort(size, kind="stable"):
        inner = (low[outer] <= low).all(axis=1) & (high[outer] >= high).all(axis=1)
        inner = np.flatnonzero(inner & (size < size[outer]) & (around < 0))
        if len(inner):
            surface = Surface(Mesh(*_alone(vertices, faces[found.of_face == outer])))
            closest = surface.closest(point[inner])
            depth = surface.signed_distance(point[inner], closest) * np.sign(volume[outer])
            around[inner[depth < 0]] = outer
    return around


def _groups(
    vertices: FloatArray, faces: IntArray, found: Shells, parent: IndexArray, gap_mm: float
) -> list[IndexArray]:
    """Bodies whose boxes meet, two or more in a group."""
    closed = found.of_face >= 0
    low, high = _boxes(vertices, faces[closed], found.of_face[closed], found.count)
    bodies = np.flatnonzero(parent == np.arange(found.count))
    bodies = bodies[np.argsort(low[bodies, 0], kind="stable")]
    low, high = low[bodies] - gap_mm, high[bodies] + gap_mm
    pairs = [np.zeros((0, 2), dtype=np.int64)]
    for at in range(len(bodies) - 1):
        last = int(np.searchsorted(low[:, 0], high[at, 0], side="right"))
        near = np.arange(at + 1, max(last, at + 1))
        meet = (low[near] <= high[at]).all(axis=1) & (high[near] >= low[at]).all(axis=1)
        pairs.append(np.stack([np.full(int(meet.sum()), at), near[meet]], axis=1))
    joined = np.concatenate(pairs)
    ones = np.ones(len(joined), dtype=np.int8)
    graph = coo_matrix((ones, (joined[:, 0], joined[:, 1])), shape=(len(bodies), len(bodies)))
    group = csgraph.connected_components(graph, directed=False)[1]
    members = [np.sort(bodies[group == each]) for each in np.flatnonzero(np.bincount(group) > 1)]
    return sorted(members, key=lambda each: int(each[0]))


def _open_that_meet(vertices: FloatArray, faces: IntArray, closed: BoolArray) -> int:
    """How many connected pieces that are not closed have boxes that meet that of a closed body."""
    if closed.all():
        return 0
    piece = topology.vertex_components(faces, len(vertices))[faces[:, 0]].astype(np.int64)
    low, high = _boxes(vertices, faces, piece, int(piece.max()) + 1)
    solid = np.zeros(len(low), dtype=np.bool_)
    solid[piece[closed]] = True
    inside_any = [
        ((low[each] <= high[solid]).all(axis=1) & (high[each] >= low[solid]).all(axis=1)).any()
        for each in np.unique(piece[~closed])
    ]
    return sum(map(int, inside_any))


def _boxes(
    vertices: FloatArray, faces: IntArray, shell: IndexArray, n_shells: int
) -> tuple[FloatArray, FloatArray]:
    """Lower and upper corner (s, 3) of each shell."""
    low, high = np.full((n_shells, 3), np.inf), np.full((n_shells, 3), -np.inf)
    for k in range(3):
        np.minimum.at(low, shell, vertices[faces[:, k]])
        np.maximum.at(high, shell, vertices[faces[:, k]])
    return low, high


def _alone(vertices: FloatArray, faces: IntArray) -> tuple[FloatArray, IntArray]:
    used, index = np.unique(faces, return_inverse=True)
    return vertices[used], index.reshape(-1, 3).astype(np.int32)


def _proper(union: Mesh, short_mm: float) -> Mesh:
    """The union without triangles without area, and with two triangles at each edge."""
    vertices, faces = without_flat(union.vertices, union.faces, CAP_AREA_SHARE, short_mm)
    edges = topology.edges(faces)
    closed = closed_pieces(faces, len(vertices), edges) >= 0
    if (edges.count != 2).any() and closed.any():
        source, faces = split_vertices(vertices, faces, shells(vertices, faces, edges, closed, None))
        vertices = vertices[source]
    return Mesh(vertices, faces)


def _without_thin_voids(union: Mesh, thickness_mm: float) -> tuple[Mesh, int]:
    """The union without the shells of voids thinner than `thickness_mm`, and how many there were."""
    shell = topology.vertex_components(union.faces, len(union.vertices))[union.faces[:, 0]].astype(np.int64)
    n_shells = int(shell.max()) + 1
    if n_shells == 1:
        return union, 0
    volume = signed_volumes(union.vertices, union.faces, shell, n_shells)
    area = np.bincount(shell, weights=union.face_areas_mm2(), minlength=n_shells)
    thin = np.flatnonzero((volume < 0) & (-2.0 * volume < thickness_mm * area))
    keep: BoolArray = ~np.isin(shell, thin)
    return Mesh(*_alone(union.vertices, union.faces[keep])), len(thin)


def _assembled(
    vertices: FloatArray,
    faces: IndexArray,
    source: IndexArray,
    added: list[Mesh],
    report: dict[str, int | float],
) -> United:
    all_vertices, all_faces, index = [vertices], [faces], [source]
    n = len(vertices)
    for mesh in added:
        all_vertices.append(mesh.vertices)
        all_faces.append(mesh.faces.astype(np.int64) + n)
        index.append(np.full(len(mesh.vertices), -1))
        n += len(mesh.vertices)
    return United(
        np.concatenate(all_vertices),
        np.concatenate(all_faces).astype(np.int32),
        np.concatenate(index),
        report,
    )
