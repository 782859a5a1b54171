"""Repair, smoothing, isotropic remeshing (pymeshlab) and decimation (fast_simplification) of a mesh."""

import fast_simplification
import numpy as np
import pymeshlab
from pymeshlab import PyMeshLabException as PyMeshLabException
from scipy.sparse import coo_matrix, csgraph

from pipeline.core.mesh import FloatArray, IndexArray, IntArray, Mesh
from pipeline.kernels import topology

FILTERS = (
    "meshing_repair_non_manifold_edges",
    "meshing_re_orient_faces_coherently",
    "meshing_isotropic_explicit_remeshing",
    "apply_coord_taubin_smoothing",
)

#: Triangles of a displayed mesh, at most: viewers become slow with more, and remeshing to thousands of
#: vertices needs no more. Chosen by hand, not fitted.
MANY_FACES = 200_000
#: Aggressiveness of the decimation, on fast_simplification's scale of 0 to 10, for smooth and for rough
#: meshes. Chosen by hand, not fitted: at 5 a smooth scan of a million triangles got edges with three
#: triangles.
CAREFUL, BOLD = 3, 5
#: Roughness (`roughness_deg`), degrees, above which a mesh is rough: its noise is as large as its triangles.
#: Chosen by hand, not fitted.
ROUGH_DEG = 10.0
#: Correlation of neighbouring vertices (`neighbour_correlation`) below which roughness is noise: they lie on
#: opposite sides of the surface more often than on the same. White noise has -0.24 (derived), the creases of
#: a CAD part and the texture of a tooth 0.2 and more.
NOISE_CORRELATION = 0.0
#: Steps of one round of smoothing, and rounds, at most: each round halves white noise or better. From
#: literature (Taubin 1995: tens of steps with the factors below); the number of rounds by hand, not fitted.
SMOOTHING_STEPS, SMOOTHING_ROUNDS = 10, 6
#: Factors of the two half steps of Taubin, "A signal processing approach to fair surface design" (1995).
TAUBIN_SHRINK, TAUBIN_INFLATE = 0.5, -0.53
#: Dihedral angle, degrees, above which remeshing keeps a crease: on a smooth mesh, at most, and on a rough
#: mesh as a multiple of the roughness. Noise makes angles between neighbours of about so many times it, and
#: each crease that is kept is a place with edges shorter than asked for. Chosen by hand, not fitted.
CREASE_DEG, MAX_CREASE_DEG, CREASE_PER_ROUGHNESS = 30, 60, 4
#: Distance from the origin over the extent, from which on a mesh is centred first. Chosen by hand: far parts
#: only, so that rounding changes nothing of the others.
FAR_EXTENTS = 10.0
#: Dihedral angle above which there is no crease (derived).
NO_CREASE_DEG = 180


def assert_filters() -> None:
    """Check at start-up that pymeshlab has all `FILTERS`; without the library `libopengl0` some are missing.

    Raises
    ------
    RuntimeError
        When a filter is missing.
    """
    missing = [name for name in FILTERS if not hasattr(pymeshlab.MeshSet, name)]
    if missing:
        raise RuntimeError(
            f"pymeshlab lacks {', '.join(missing)}: install the system libraries libopengl0 libgl1 libegl1"
        )


def repair_non_manifold_edges(mesh: Mesh) -> tuple[IntArray, IndexArray]:
    """Remove the smallest faces at every edge with more than two faces.

    Returns
    -------
    faces : (m', 3) over the remaining vertices; old_of_new : (n',), `mesh.vertices[old_of_new]` are the
    remaining vertices
    """
    return _tracked(mesh, "meshing_repair_non_manifold_edges", method="Remove Faces")


def orient_coherently(mesh: Mesh) -> tuple[IntArray, IndexArray]:
    """Flip faces so that neighbours have the same orientation; returns as `repair_non_manifold_edges`."""
    return _tracked(mesh, "meshing_re_orient_faces_coherently")


def crease_deg(mesh: Mesh) -> float:
    """Dihedral angle, degrees, above which an edge is a crease that the roughness does not make."""
    return float(np.clip(CREASE_PER_ROUGHNESS * roughness_deg(mesh), CREASE_DEG, MAX_CREASE_DEG))


def isotropic(mesh: Mesh, edge_mm: float, iterations: int, *, crease_angle_deg: float | None = None) -> Mesh:
    """Remesh the surface with edges of about `edge_mm` by pymeshlab: for simulated scans, as another
    triangulation than that of the working mesh (`kernels.isotropic`). Creases sharper than `crease_angle_deg`
    are kept, by default those that the roughness does not make.
    """
    centre_mm = _centre_mm(mesh)
    meshes = _meshset(mesh, centre_mm)
    meshes.meshing_isotropic_explicit_remeshing(
        iterations=iterations,
        targetlen=pymeshlab.PureValue(edge_mm),
        featuredeg=crease_deg(mesh) if crease_angle_deg is None else crease_angle_deg,
        checksurfdist=False,
    )
    return _current(meshes, centre_mm)


def without_tiny_edges(mesh: Mesh, min_mm: float) -> Mesh:
    """The mesh with the ends of every edge shorter than `min_mm` merged, at the place of the first of them.

    Coincident vertices of a tangled surface cost geodesics without end: a front goes round between them in
    ever narrower windows.
    """
    mesh_edges = topology.edges(mesh.faces)
    lengths = np.linalg.norm(np.diff(mesh.vertices[mesh_edges.ends], axis=1)[:, 0], axis=1)
    ends = mesh_edges.ends[lengths < min_mm]
    if not len(ends):
        return mesh
    n = len(mesh.vertices)
    graph = coo_matrix((np.ones(len(ends), dtype=np.int8), (ends[:, 0], ends[:, 1])), shape=(n, n))
    merged = csgraph.connected_components(graph, directed=False)[1]
    _, first = np.unique(merged, return_index=True)
    a, b, c = merged[mesh.faces].T
    keep = (a != b) & (b != c) & (c != a)
    return Mesh(mesh.vertices[first], merged[mesh.faces][keep].astype(np.int32))


def denoised(mesh: Mesh) -> Mesh:
    """A noisy mesh (`is_noisy`), smoothed until it is no longer rough.

    Noise as large as the triangles looks like creases everywhere: remeshing would keep all of them, with
    edges far shorter than asked for. Smoothing by Taubin's filter, which keeps the volume and all that is
    much larger than a triangle.
    """
    centre_mm = _centre_mm(mesh)
    for _ in range(SMOOTHING_ROUNDS):
        meshes = _meshset(mesh, centre_mm)
        meshes.apply_coord_taubin_smoothing(
            lambda_=TAUBIN_SHRINK, mu=TAUBIN_INFLATE, stepsmoothnum=SMOOTHING_STEPS
        )
        mesh = _current(meshes, centre_mm)
        if roughness_deg(mesh) <= ROUGH_DEG:
            break
    return mesh


def is_noisy(mesh: Mesh) -> bool:
    """Whether the mesh is rough, and by noise: neighbouring vertices lie on opposite sides of the surface."""
    return roughness_deg(mesh) > ROUGH_DEG and neighbour_correlation(mesh) < NOISE_CORRELATION


def neighbour_correlation(mesh: Mesh) -> float:
    """Correlation of how far the two ends of an edge stick out, in [-1, 1]; 0 for a mesh without curvature.

    A vertex sticks out by its distance from the mean of its neighbours, along its normal.
    """
    faces, n = mesh.faces, len(mesh.vertices)
    total = np.zeros_like(mesh.vertices)
    sum_of_face = mesh.vertices[faces].sum(axis=1)
    for corner in range(3):  # the two other corners of every triangle: each neighbour twice, at a border once
        others = sum_of_face - mesh.vertices[faces[:, corner]]
        for axis in range(3):
            total[:, axis] += np.bincount(faces[:, corner], others[:, axis], n)
    count = 2 * np.bincount(faces.ravel(), minlength=n)
    mean = total / np.maximum(count, 1)[:, None]
    out_mm = np.where(count > 0, np.einsum("kd,kd->k", mesh.vertices - mean, mesh.vertex_normals()), 0.0)
    of_corner = out_mm[faces]
    size = float((of_corner**2).sum())
    return float((of_corner * np.roll(of_corner, 1, axis=1)).sum()) / size if size > 0 else 0.0


def edge_mm(mesh: Mesh, share: float) -> float:
    """The length that `share` of the edges do not exceed: 0.5 for the median. `mesh` has a triangle."""
    corners = mesh.vertices[mesh.faces]
    lengths = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
    return float(np.quantile(lengths, share))


def decimated(mesh: Mesh, n_faces: int) -> Mesh:
    """Decimate to about `n_faces` triangles, up to twice as many on a surface that is smooth everywhere.

    Quadric edge collapse (Forstmann's implementation: ten times faster than pymeshlab's; it cuts the corners
    of open borders slightly). No edge of the result has three triangles.

    A mesh that is rougher than `ROUGH_DEG` is decimated with `BOLD` aggressiveness: with `CAREFUL` the noise
    limits every collapse, and a scan of a million triangles stays at two thirds of them. The few edges with
    three triangles that this leaves are removed.
    """
    if roughness_deg(mesh) <= ROUGH_DEG:
        return _simplified(mesh, n_faces, CAREFUL)
    simplified = _simplified(mesh, n_faces, BOLD)
    faces, old_of_new = repair_non_manifold_edges(simplified)
    return Mesh(simplified.vertices[old_of_new], faces)


def roughness_deg(mesh: Mesh) -> float:
    """Median angle, degrees, between the normal of a triangle and the vertex normal at its first corner."""
    cross = mesh.face_cross_mm2()
    along = np.einsum("kd,kd->k", cross, mesh.vertex_normals()[mesh.faces[:, 0]])
    size = np.linalg.norm(cross, axis=1)
    cosine = np.divide(along, size, out=np.ones_like(along), where=size > 0)
    return float(np.degrees(np.arccos(np.clip(np.median(cosine), -1.0, 1.0))))


def _simplified(mesh: Mesh, n_faces: int, aggressiveness: int) -> Mesh:
    centre_mm = _centre_mm(mesh)
    vertices, faces = fast_simplification.simplify(
        mesh.vertices - centre_mm, np.array(mesh.faces), target_count=n_faces, agg=aggressiveness
    )
    return Mesh(vertices + centre_mm, faces)


def _centre_mm(mesh: Mesh) -> FloatArray:
    """(3,) what to subtract before the libraries see a mesh far from the origin, whose coordinates they round
    or square: the middle of its box; 0 for a mesh near the origin.
    """
    if len(mesh.vertices) == 0:
        return np.zeros(3)
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    middle = (low + high) / 2
    return middle if np.abs(middle).max() > FAR_EXTENTS * (high - low).max() else np.zeros(3)


def _meshset(mesh: Mesh, centre_mm: FloatArray, scalar: FloatArray | None = None) -> pymeshlab.MeshSet:
    meshes = pymeshlab.MeshSet(verbose=False)
    extra = {} if scalar is None else {"v_scalar_array": scalar}
    meshes.add_mesh(pymeshlab.Mesh(mesh.vertices - centre_mm, mesh.faces, **extra))
    return meshes


def _current(meshes: pymeshlab.MeshSet, centre_mm: FloatArray) -> Mesh:
    current = meshes.current_mesh()
    return Mesh(
        np.array(current.vertex_matrix()) + centre_mm, np.array(current.face_matrix(), dtype=np.int32)
    )


def _tracked(mesh: Mesh, name: str, **arguments: str) -> tuple[IntArray, IndexArray]:
    """Apply a filter that only removes or flips faces; the vertex scalar carries the original index."""
    meshes = _meshset(mesh, _centre_mm(mesh), np.arange(len(mesh.vertices), dtype=np.float64))
    getattr(meshes, name)(**arguments)
    current = meshes.current_mesh()
    return (
        np.array(current.face_matrix(), dtype=np.int32),
        np.array(current.vertex_scalar_array()).round().astype(np.int64),
    )
