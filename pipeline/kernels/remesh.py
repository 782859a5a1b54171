"""What pymeshlab and fast_simplification do for us, array in, array out: repair, isotropic remeshing,
decimation.
"""

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

MANY_FACES = 200_000  # viewers choke on more, and remeshing to thousands of vertices needs no more

# Of fast_simplification's 0 to 10: at 5 a smooth scan of a million triangles came out with edges of three
# triangles.
CAREFUL, BOLD = 3, 5
# of triangles against the surface at their corners: the noise is as large as the triangles
ROUGH_DEG = 10.0


def assert_filters() -> None:
    """Fail at start-up, not in a job: without the system library `libopengl0` pymeshlab silently lacks
    filters.

    Raises
    ------
    RuntimeError
    """
    missing = [name for name in FILTERS if not hasattr(pymeshlab.MeshSet, name)]
    if missing:
        raise RuntimeError(
            f"pymeshlab lacks {', '.join(missing)}: install the system libraries libopengl0 libgl1 libegl1"
        )


def repair_non_manifold_edges(mesh: Mesh) -> tuple[IntArray, IndexArray]:
    """Drop the smallest faces at every edge shared by more than two.

    Returns
    -------
    faces : (m', 3) over kept vertices; old_of_new : (n',) with `mesh.vertices[old_of_new]` the kept
    vertices
    """
    return _tracked(mesh, "meshing_repair_non_manifold_edges", method="Remove Faces")


def orient_coherently(mesh: Mesh) -> tuple[IntArray, IndexArray]:
    """Turn faces so that neighbours agree; returns as `repair_non_manifold_edges`."""
    return _tracked(mesh, "meshing_re_orient_faces_coherently")


def isotropic(mesh: Mesh, edge_mm: float, iterations: int) -> Mesh:
    """Triangles of nearly equal edges of `edge_mm` on the same surface; creases sharper than 30 degrees
    stay.
    """
    meshes = _meshset(mesh)
    meshes.meshing_isotropic_explicit_remeshing(
        iterations=iterations, targetlen=pymeshlab.PureValue(edge_mm), featuredeg=30, checksurfdist=False
    )
    return _current(meshes)


def decimated(mesh: Mesh, n_faces: int) -> Mesh:
    """About `n_faces` triangles, up to twice as many where the surface is smooth everywhere, by quadric
    edge collapse (Forstmann's: ten times faster than pymeshlab's; corners of open borders are cut a
    little). No edge has three.

    A scan whose noise is as large as its triangles is taken boldly: to the careful every collapse costs
    the noise, it stops at two thirds of a million triangles. The handful of edges of three that boldness
    leaves are cut open.
    """
    if roughness_deg(mesh) <= ROUGH_DEG:
        return _simplified(mesh, n_faces, CAREFUL)
    few = _simplified(mesh, n_faces, BOLD)
    faces, kept = repair_non_manifold_edges(few)
    return Mesh(few.vertices[kept], faces)


def roughness_deg(mesh: Mesh) -> float:
    """Median angle between a triangle and the mean surface at its first corner."""
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
    """Apply a filter that only drops or turns; the vertex scalar carries each vertex's old number."""
    meshes = _meshset(mesh, np.arange(len(mesh.vertices), dtype=np.float64))
    getattr(meshes, name)(**arguments)
    current = meshes.current_mesh()
    return (
        np.array(current.face_matrix(), dtype=np.int32),
        np.array(current.vertex_scalar_array()).round().astype(np.int64),
    )
