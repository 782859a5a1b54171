"""Remove what later stages cannot use, and say what was removed."""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_matrix, csgraph
from scipy.spatial import cKDTree

from pipeline.core.errors import DegenerateMesh, TooFewPoints
from pipeline.core.mesh import BoolArray, FloatArray, IndexArray, IntArray, Mesh
from pipeline.core.settings import CleanSettings
from pipeline.kernels import remesh, topology
from pipeline.kernels.rows import group_rows

MIN_FACES = 4  # a tetrahedron: fewer triangles have no shape to find a pose by
MIN_POINTS = 30


@dataclass(frozen=True, slots=True)
class Cleaned:
    """mesh : the kept part; old_of_new : (n,) int64 with `old.vertices[old_of_new] == mesh.vertices`;
    report : what was removed, by kind, for `provenance.inputs.<mesh>.cleaning`
    """

    mesh: Mesh
    old_of_new: IndexArray
    report: dict[str, int | float]


def clean(mesh: Mesh, name: str, settings: CleanSettings) -> Cleaned:
    """Merge bit-equal vertices (first occurrence first), then drop degenerate and duplicate faces, faces at
    non-manifold edges, small components, and vertices nobody uses.

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

    faces, report["degenerate_faces"] = _keep(faces, ~_degenerate(Mesh(vertices, faces)))
    faces, report["duplicate_faces"] = _keep(faces, _first_of_each(np.sort(faces, axis=1)))
    if len(faces) < MIN_FACES:
        raise DegenerateMesh(
            f"{report['faces_in']} triangles came, {len(faces)} of them with an area; at least {MIN_FACES} are needed",
            mesh=name,
        )
    old_of_new = first
    report["non_manifold_faces"] = 0
    if settings.repair_non_manifold and (edges.of(faces).count > 2).any():
        before = len(faces)
        faces, kept = remesh.repair_non_manifold_edges(Mesh(vertices, faces))
        vertices, old_of_new = vertices[kept], old_of_new[kept]
        report["non_manifold_faces"] = before - len(faces)
    faces, report["small_components"] = _drop_small_components(
        Mesh(vertices, faces), settings.min_component_share
    )
    vertices, faces, old_of_new, report["turned_faces"] = _oriented(vertices, faces, old_of_new, edges)

    used = np.zeros(len(vertices), dtype=np.bool_)
    used[faces.ravel()] = True
    report["unused_vertices"] = int((~used).sum())
    kept_mesh = Mesh(vertices[used], (np.cumsum(used) - 1)[faces].astype(np.int32))
    if len(kept_mesh.faces) < MIN_FACES:
        raise DegenerateMesh(f"only {len(kept_mesh.faces)} triangles are left after the repair", mesh=name)
    report |= {"vertices": len(kept_mesh.vertices), "faces": len(kept_mesh.faces)}
    return Cleaned(kept_mesh, old_of_new[used], report)


def _cleaned_cloud(mesh: Mesh, name: str, first: IndexArray, report: dict[str, int | float]) -> Cleaned:
    if len(first) < MIN_POINTS:
        raise TooFewPoints(f"{len(first)} different points; at least {MIN_POINTS} are needed", mesh=name)
    if np.ptp(mesh.vertices, axis=0).max() == 0:
        raise DegenerateMesh("all points are one point", mesh=name)
    return Cleaned(Mesh(mesh.vertices[first]), first, report | {"vertices": len(first), "faces": 0})


class _EdgesOf:
    """The edges of the faces asked for last: of a million triangles they take most of the cleaning, and seldom change."""

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
    """Close cracks: border vertices within `tolerance_mm` become one, the first of them.

    Exporters that round each triangle on its own leave corners that differ in the last bit; such a closed part
    would count as open everywhere.
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
    """Faces that name a vertex twice, or whose height is lost in rounding: no normal can be had from them."""
    corners = mesh.vertices[mesh.faces]
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1, initial=0.0)
    repeated = (mesh.faces == np.roll(mesh.faces, 1, axis=1)).any(axis=1)
    return np.asarray(repeated | (mesh.face_areas_mm2() <= 1e-12 * longest**2), dtype=np.bool_)


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
    """Neighbours agree on the outside, and closed pieces have it outside (positive volume)."""
    before = faces
    if not topology.is_coherent(faces):
        faces, kept = remesh.orient_coherently(Mesh(vertices, faces))
        vertices, old_of_new = vertices[kept], old_of_new[kept]
    turned = int((before != faces).any(axis=1).sum()) if len(before) == len(faces) else len(faces)
    inside_out = _inside_out_faces(Mesh(vertices, faces), edges)
    faces = np.where(inside_out[:, None], faces[:, ::-1], faces).astype(np.int32)
    return vertices, faces, old_of_new, turned + int(inside_out.sum())


def _inside_out_faces(mesh: Mesh, edges: _EdgesOf) -> BoolArray:
    """(m,) all faces of a closed mesh that is inside out, else none: an open surface has no volume.

    An inner shell of a hollow part rightly points inwards, and holds less than the outer one. So a mesh is inside out when
    its volume is negative, unless a piece that is not lies beside the negative ones: then nothing is certain.
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
