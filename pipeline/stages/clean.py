"""Mesh repair: removes elements that later stages cannot use, and reports what was removed."""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_matrix, csgraph
from scipy.spatial import cKDTree

from pipeline.core.errors import DegenerateMesh, TooFewPoints
from pipeline.core.mesh import BoolArray, FloatArray, IndexArray, IntArray, Mesh
from pipeline.core.settings import CleanSettings
from pipeline.kernels import remesh, topology
from pipeline.kernels.rows import group_rows
from pipeline.stages.bodies import unite
from pipeline.stages.open_bodies import within_others

#: Min number of triangles: a tetrahedron is the smallest closed surface (derived).
MIN_FACES = 4
#: Min number of distinct points of a point cloud. Chosen by hand; not fitted.
MIN_POINTS = 30
#: A triangle whose area is below this share of its longest edge squared has no reliable normal: its height is
#: lost in rounding (double precision, with a margin). Chosen by hand.
DEGENERATE_AREA_SHARE = 1e-12


@dataclass(frozen=True, slots=True)
class Cleaned:
    """mesh : the kept part; old_of_new : (n,) int64 with `old.vertices[old_of_new] == mesh.vertices`, -1 of a
    vertex that the union of bodies made; report : what was removed, by kind, for
    `provenance.inputs.<mesh>.cleaning`
    """

    mesh: Mesh
    old_of_new: IndexArray
    report: dict[str, int | float]


def clean(mesh: Mesh, name: str, settings: CleanSettings, body_of_face: IntArray | None = None) -> Cleaned:
    """Merge bit-equal vertices (first occurrence first), unite closed bodies that meet, then drop degenerate
    and duplicate faces, faces at non-manifold edges, small components and unused vertices.

    body_of_face : (m,) body of each face as the file has them, None of one body

    Raises
    ------
    DegenerateMesh, TooFewPoints
    """
    first, merged_of_old = group_rows(mesh.vertices + 0.0)  # -0.0 is 0.0
    report: dict[str, int | float] = {
        "vertices_in": len(mesh.vertices),
        "faces_in": len(mesh.faces),
        "merged_vertices": len(mesh.vertices) - len(first),
    }
    if mesh.is_cloud:
        return _cleaned_cloud(mesh, name, first, report)
    vertices = mesh.vertices[first]
    faces = merged_of_old[mesh.faces].astype(np.int32)
    edges = _EdgesOf()
    weld_mm = settings.weld_share * mesh.diagonal_mm
    faces, report["welded_vertices"] = _welded(vertices, faces, edges.of(faces), weld_mm)

    old_of_new, total = first, len(faces)
    if settings.unite_bodies:
        whole = ~_has_repeated(faces)
        faces = faces[whole]
        united = unite(
            vertices, faces, edges.of(faces), None if body_of_face is None else body_of_face[whole]
        )
        if united is not None:
            vertices, faces = united.vertices, united.faces
            old_of_new = np.where(united.old_of_new < 0, -1, first[united.old_of_new])
            report |= united.report
            total = len(faces) + int((~whole).sum())
        if name == "design":  # what a scanner saw within is measured
            inside = within_others(vertices, faces, edges.of(faces))
            if inside.any():
                report["faces_within_others"] = int(inside.sum())
                report["area_within_others_mm2"] = float(Mesh(vertices, faces).face_areas_mm2()[inside].sum())
                faces, total = faces[~inside], total - int(inside.sum())
    faces, _ = _keep(faces, ~_degenerate(Mesh(vertices, faces)))
    report["degenerate_faces"] = total - len(faces)
    faces, report["duplicate_faces"] = _keep(faces, _first_of_each(np.sort(faces, axis=1)))
    if len(faces) < MIN_FACES:
        raise DegenerateMesh(
            f"{len(faces)} of {report['faces_in']} triangles have an area; at least {MIN_FACES} are required",
            mesh=name,
        )
    report["non_manifold_faces"] = 0
    if settings.repair_non_manifold and (edges.of(faces).count > 2).any():
        before = len(faces)
        faces, kept = remesh.repair_non_manifold_edges(Mesh(vertices, faces))
        vertices, old_of_new = vertices[kept], old_of_new[kept]
        report["non_manifold_faces"] = before - len(faces)
    faces, report["small_components"] = _drop_small_components(
        Mesh(vertices, faces), settings.min_component_share
    )
    already = int(report.get("turned_faces", 0))
    vertices, faces, old_of_new, turned = _oriented(vertices, faces, old_of_new, edges)
    report["turned_faces"] = already + turned

    used = np.zeros(len(vertices), dtype=np.bool_)
    used[faces.ravel()] = True
    report["unused_vertices"] = int((~used).sum())
    kept_mesh = Mesh(vertices[used], (np.cumsum(used) - 1)[faces].astype(np.int32))
    if len(kept_mesh.faces) < MIN_FACES:
        raise DegenerateMesh(f"only {len(kept_mesh.faces)} triangles remain after the repair", mesh=name)
    report |= {"vertices": len(kept_mesh.vertices), "faces": len(kept_mesh.faces)}
    return Cleaned(kept_mesh, old_of_new[used], report)


def _cleaned_cloud(mesh: Mesh, name: str, first: IndexArray, report: dict[str, int | float]) -> Cleaned:
    if len(first) < MIN_POINTS:
        raise TooFewPoints(f"{len(first)} distinct points; at least {MIN_POINTS} are required", mesh=name)
    if np.ptp(mesh.vertices, axis=0).max() == 0:
        raise DegenerateMesh("all points coincide", mesh=name)
    return Cleaned(Mesh(mesh.vertices[first]), first, report | {"vertices": len(first), "faces": 0})


class _EdgesOf:
    """Cache of the edges of the most recent faces: they take most of the run time and rarely change."""

    def __init__(self) -> None:
        self._faces = np.zeros((0, 3), dtype=np.int32)
        self._edges = topology.edges(self._faces)

    def of(self, faces: IntArray) -> topology.Edges:
        if not np.array_equal(faces, self._faces):
            self._faces, self._edges = faces, topology.edges(faces)
        return self._edges


def _welded(
    vertices: FloatArray, faces: IntArray, edges: topology.Edges, tolerance_mm: float
) -> tuple[IntArray, int]:
    """Close cracks: border vertices within `tolerance_mm` are merged into the first of them.

    Some exporters round each triangle separately and write corners that differ in the last bit. Without
    welding, such a closed part would be open at every edge.
    """
    border = np.unique(edges.ends[edges.count == 1])
    if tolerance_mm == 0 or border.size == 0:
        return faces, 0
    pairs = cKDTree(vertices[border]).query_pairs(tolerance_mm, output_type="ndarray")
    graph = coo_matrix((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(border.size, border.size))
    group = csgraph.connected_components(graph, directed=False)[1]
    first = border[np.unique(group, return_index=True)[1]]
    new_of_old = np.arange(len(vertices))
    new_of_old[border] = first[group]
    return new_of_old[faces].astype(np.int32), int((new_of_old[border] != border).sum())


def _keep(faces: IntArray, keep: BoolArray) -> tuple[IntArray, int]:
    return faces[keep], int((~keep).sum())


def _degenerate(mesh: Mesh) -> BoolArray:
    """(m,) faces without a normal: with a repeated vertex, or with a height below rounding."""
    corners = mesh.vertices[mesh.faces]
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1, initial=0.0)
    flat = mesh.face_areas_mm2() <= DEGENERATE_AREA_SHARE * longest**2
    return np.asarray(_has_repeated(mesh.faces) | flat, dtype=np.bool_)


def _has_repeated(faces: IntArray) -> BoolArray:
    """(m,) faces with a vertex twice."""
    return np.asarray((faces == np.roll(faces, 1, axis=1)).any(axis=1))


def _first_of_each(rows: IntArray) -> BoolArray:
    keep = np.zeros(len(rows), dtype=np.bool_)
    keep[group_rows(rows)[0]] = True
    return keep


def _drop_small_components(mesh: Mesh, min_share: float) -> tuple[IntArray, int]:
    if min_share == 0:
        return mesh.faces, 0
    piece = topology.vertex_components(mesh.faces, len(mesh.vertices))[mesh.faces[:, 0]]
    areas = np.bincount(piece, weights=mesh.face_areas_mm2())
    small = (areas < min_share * areas.sum()) & (areas > 0)
    return mesh.faces[~small[piece]], int(small.sum())


def _oriented(
    vertices: FloatArray, faces: IntArray, old_of_new: IndexArray, edges: _EdgesOf
) -> tuple[FloatArray, IntArray, IndexArray, int]:
    """Faces with consistent orientation; closed meshes have outward normals (positive volume)."""
    before = faces
    if not topology.is_coherent(faces):
        faces, kept = remesh.orient_coherently(Mesh(vertices, faces))
        vertices, old_of_new = vertices[kept], old_of_new[kept]
    turned = int((before != faces).any(axis=1).sum()) if len(before) == len(faces) else len(faces)
    inside_out = _inside_out_faces(Mesh(vertices, faces), edges)
    faces = np.where(inside_out[:, None], faces[:, ::-1], faces).astype(np.int32)
    return vertices, faces, old_of_new, turned + int(inside_out.sum())


def _inside_out_faces(mesh: Mesh, edges: _EdgesOf) -> BoolArray:
    """(m,) true for all faces of a closed mesh with inward normals, false otherwise; open surfaces have no
    volume.

    The inner shell of a hollow part has inward normals and encloses less than the outer shell. So the mesh is
    inverted if its total volume is negative and every component of positive volume lies inside one of
    negative volume.
    """
    no_faces = np.zeros(len(mesh.faces), dtype=np.bool_)
    if not (edges.of(mesh.faces).count == 2).all():
        return no_faces
    piece = topology.vertex_components(mesh.faces, len(mesh.vertices))
    a, b, c = (mesh.vertices[mesh.faces[:, k]] - mesh.vertices[0] for k in range(3))
    volume = np.bincount(piece[mesh.faces[:, 0]], weights=np.einsum("ij,ij->i", a, np.cross(b, c)))
    if volume.sum() >= 0:
        return no_faces
    low, high = np.full((len(volume), 3), np.inf), np.full((len(volume), 3), -np.inf)
    np.minimum.at(low, piece, mesh.vertices)
    np.maximum.at(high, piece, mesh.vertices)
    outer = np.flatnonzero(volume < 0)
    inner = [(low[outer] <= low[k]) & (high[outer] >= high[k]) for k in np.flatnonzero(volume > 0)]
    return no_faces | all(inside.all(axis=1).any() for inside in inner)
