"""Bodies that touch or overlap, as one surface: the walls between them are no surface that anybody measures.

Closed bodies are united (`kernels.solid_union`). Cavities (shells with normals inwards, within a body) stay
cavities. Bodies that do not meet, and surfaces that are not closed, stay as they are.
"""

from dataclasses import dataclass

import numpy as np

from pipeline.core.mesh import BoolArray, FloatArray, IndexArray, IntArray, Mesh
from pipeline.kernels import topology
from pipeline.kernels.caps import without_flat
from pipeline.kernels.nesting import alone, boxes, deep_within, meeting, meets_any, smallest_around
from pipeline.kernels.shells import Shells, closed_pieces, shells, signed_volumes, split_vertices
from pipeline.kernels.solid_union import GAP_SHARE, united

#: Bodies meet when less than this share of their surface is left after the union. Derived: rounding.
MEETING_SHARE = 1e-6
#: A void between united bodies that is thinner than this share of the diagonal is filled: two walls that
#: touch, tessellated differently. Chosen by hand: the chord error of a CAD export.
THIN_VOID_SHARE = 1e-3
#: A triangle of less area than this share of its longest edge squared has a corner on its opposite edge.
#: Derived: above what `clean` drops, below rounding of single precision.
CAP_AREA_SHARE = 1e-10
#: Corners of such triangles are merged where they are nearer than this many gaps. Chosen by hand: walls that
#: meet at a small angle cross that far apart; 3,000 random assemblies of boxes stay closed.
SHORT_GAPS = 16.0


#: A void of the union that has the volume of a cavity to this share is that cavity. Derived: growth by the
#: gap changes a cavity of a hundredth of the diagonal by less.
SAME_VOLUME = 1e-3
#: Of more triangles than this, bodies of less area than `SMALL_SHARE` of all are not united: specks of a CT
#: scan, in the pores of the part. Chosen by hand; a union of that size takes seconds.
MANY_FACES, SMALL_SHARE = 500_000, 1e-3


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
    deep = deep_within(mesh, found, parent)
    inside = closed & np.isin(parent[found.of_face], deep)
    kept[inside] = False
    report["united_bodies"] += len(deep) + (len(deep) > 0)
    report["internal_area_mm2"] += float(areas[inside].sum())
    volume = signed_volumes(vertices, faces[closed], found.of_face[closed], found.count)
    order = np.argsort(np.where(closed, parent[found.of_face], -1), kind="stable")
    ends = np.cumsum(np.bincount(parent[found.of_face[closed]], minlength=found.count)) + int((~closed).sum())
    for group in _groups(mesh, found, parent, deep):
        members = [order[ends[each - 1] if each else int((~closed).sum()) : ends[each]] for each in group]
        union = united([alone(vertices, faces[mine]) for mine in members], mesh.diagonal_mm)
        if union is None:
            report["bodies_not_united"] += len(group)
            continue
        before = np.concatenate(members)
        union = _proper(union, SHORT_GAPS * GAP_SHARE * mesh.diagonal_mm)
        cavities = np.flatnonzero(np.isin(parent, group) & (volume < 0))
        thin_mm = THIN_VOID_SHARE * mesh.diagonal_mm
        union, n_voids = _without_thin_voids(union, thin_mm, volume[cavities])
        internal_mm2 = float(areas[before].sum() - union.face_areas_mm2().sum())
        if internal_mm2 < MEETING_SHARE * areas[before].sum():
            continue
        kept[before] = False
        added.append(union)
        report["united_bodies"] += len(group)
        report["internal_area_mm2"] += internal_mm2
        report["filled_voids"] += n_voids
    if not (added or len(deep) or found.shared_edges or turned or report["bodies_not_united"]):
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
    around = smallest_around(vertices, faces, found, volume)
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


def _groups(mesh: Mesh, found: Shells, parent: IndexArray, deep: IndexArray) -> list[IndexArray]:
    """Bodies whose boxes meet, two or more in a group; without those `deep` within another, and the smallest
    of a large mesh.
    """
    closed = found.of_face >= 0
    shell = found.of_face[closed]
    bodies = np.setdiff1d(np.flatnonzero(parent == np.arange(found.count)), deep)
    if len(shell) > MANY_FACES:
        areas = np.bincount(shell, weights=mesh.face_areas_mm2()[closed], minlength=found.count)
        bodies = bodies[areas[bodies] > SMALL_SHARE * areas.sum()]
    low, high = boxes(mesh.vertices, mesh.faces[closed], shell, found.count)
    gap_mm = GAP_SHARE * mesh.diagonal_mm
    return [bodies[group] for group in meeting(low[bodies] - gap_mm, high[bodies] + gap_mm)]


def _open_that_meet(vertices: FloatArray, faces: IntArray, closed: BoolArray) -> int:
    """How many connected pieces that are not closed have boxes that meet that of a closed body."""
    if closed.all():
        return 0
    piece = topology.vertex_components(faces, len(vertices))[faces[:, 0]].astype(np.int64)
    low, high = boxes(vertices, faces, piece, int(piece.max()) + 1)
    solid, open_ = np.unique(piece[closed]), np.unique(piece[~closed])
    return int(meets_any(low[open_], high[open_], low[solid], high[solid]).sum())


def _proper(union: Mesh, short_mm: float) -> Mesh:
    """The union without triangles without area, and with two triangles at each edge."""
    vertices, faces = without_flat(union.vertices, union.faces, CAP_AREA_SHARE, short_mm)
    edges = topology.edges(faces)
    closed = closed_pieces(faces, len(vertices), edges) >= 0
    if (edges.count != 2).any() and closed.any():
        source, faces = split_vertices(vertices, faces, shells(vertices, faces, edges, closed, None))
        vertices = vertices[source]
    return Mesh(vertices, faces)


def _without_thin_voids(union: Mesh, thickness_mm: float, cavities_mm3: FloatArray) -> tuple[Mesh, int]:
    """The union without the shells of voids between its bodies thinner than `thickness_mm`, and how many
    there were. cavities_mm3 : signed volumes of the cavities that the bodies have themselves, which stay
    """
    shell = topology.vertex_components(union.faces, len(union.vertices))[union.faces[:, 0]].astype(np.int64)
    n_shells = int(shell.max()) + 1
    if n_shells == 1:
        return union, 0
    volume = signed_volumes(union.vertices, union.faces, shell, n_shells)
    area = np.bincount(shell, weights=union.face_areas_mm2(), minlength=n_shells)
    own = np.isclose(volume[:, None], cavities_mm3, rtol=SAME_VOLUME, atol=0.0).any(axis=1)
    thin = np.flatnonzero((volume < 0) & ~own & (-2.0 * volume < thickness_mm * area))
    keep: BoolArray = ~np.isin(shell, thin)
    return Mesh(*alone(union.vertices, union.faces[keep])), len(thin)


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
