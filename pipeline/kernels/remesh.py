"""Repair, isotropic remeshing (pymeshlab) and decimation (fast_simplification) of a mesh."""

import fast_simplification
import numpy as np
import pymeshlab
from pymeshlab import PyMeshLabException as PyMeshLabException

from pipeline.core.mesh import FloatArray, IndexArray, IntArray, Mesh

FILTERS = (
    "meshing_repair_non_manifold_edges",
    "meshing_re_orient_faces_coherently",
    "meshing_isotropic_explicit_remeshing",
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
#: Dihedral angle, degrees, above which remeshing keeps a crease. Chosen by hand, not fitted.
CREASE_DEG = 30


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


def isotropic(mesh: Mesh, edge_mm: float, iterations: int) -> Mesh:
    """Remesh the surface with edges of about `edge_mm`; creases sharper than `CREASE_DEG` are kept."""
    meshes = _meshset(mesh)
    meshes.meshing_isotropic_explicit_remeshing(
        iterations=iterations,
        targetlen=pymeshlab.PureValue(edge_mm),
        featuredeg=CREASE_DEG,
        checksurfdist=False,
    )
    return _current(meshes)


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
    vertices, faces = fast_simplification.simplify(
        np.array(mesh.vertices), np.array(mesh.faces), target_count=n_faces, agg=aggressiveness
    )
    return Mesh(vertices, faces)


def _meshset(mesh: Mesh, scalar: FloatArray | None = None) -> pymeshlab.MeshSet:
    meshes = pymeshlab.MeshSet(verbose=False)
    extra = {} if scalar is None else {"v_scalar_array": scalar}
    meshes.add_mesh(pymeshlab.Mesh(mesh.vertices, mesh.faces, **extra))
    return meshes


def _current(meshes: pymeshlab.MeshSet) -> Mesh:
    current = meshes.current_mesh()
    return Mesh(np.array(current.vertex_matrix()), np.array(current.face_matrix(), dtype=np.int32))


def _tracked(mesh: Mesh, name: str, **arguments: str) -> tuple[IntArray, IndexArray]:
    """Apply a filter that only removes or flips faces; the vertex scalar carries the original index."""
    meshes = _meshset(mesh, np.arange(len(mesh.vertices), dtype=np.float64))
    getattr(meshes, name)(**arguments)
    current = meshes.current_mesh()
    return (
        np.array(current.face_matrix(), dtype=np.int32),
        np.array(current.vertex_scalar_array()).round().astype(np.int64),
    )
