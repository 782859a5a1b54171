"""The faces of a CAD model on the cleaned mesh, and the segment that each lies in."""

import numpy as np

from pipeline.core.brep_faces import NO_FACE, BrepFaces
from pipeline.core.mesh import FloatArray, IndexArray, IntArray, Mesh
from pipeline.kernels.surface import Surface

#: Segment of a face without triangles on the cleaned mesh: inside of a united part.
NO_SEGMENT = -1


def on_cleaned(mesh: Mesh, loaded: Mesh, brep: BrepFaces) -> BrepFaces:
    """The same faces on the triangles of `mesh`, the cleaned one: that of the triangle of `loaded` below the
    centroid of each. brep : of `loaded`
    """
    centroids = mesh.vertices[mesh.faces].mean(axis=1)
    return brep.at(Surface(loaded).closest(centroids).face)


def areas_mm2(mesh: Mesh, brep: BrepFaces) -> FloatArray:
    """(k,) area of each face on `mesh`."""
    of, areas = brep.of_triangle, mesh.face_areas_mm2()
    known = of != NO_FACE
    return np.bincount(of[known], weights=areas[known], minlength=len(brep.faces)).astype(np.float64)


def centres_mm(mesh: Mesh, brep: BrepFaces) -> FloatArray:
    """(k, 3) centroid of each face on `mesh`; nan where it has no triangles."""
    of, areas = brep.of_triangle, mesh.face_areas_mm2()
    known = of != NO_FACE
    centroids = mesh.vertices[mesh.faces[known]].mean(axis=1)
    sums = [
        np.bincount(of[known], weights=areas[known] * axis, minlength=len(brep.faces)) for axis in centroids.T
    ]
    total = areas_mm2(mesh, brep)[:, None]
    empty: FloatArray = np.full((len(total), 3), np.nan)
    return np.asarray(np.divide(np.stack(sums, axis=1), total, out=empty, where=total > 0))


def segment_of_brep(mesh: Mesh, brep: BrepFaces, segment_of_face: IntArray) -> IndexArray:
    """(k,) segment that holds the largest area of each face, `NO_SEGMENT` where it has no triangles.

    segment_of_face : (m,) segment of each triangle of `mesh`
    """
    known = np.flatnonzero(brep.of_triangle != NO_FACE)
    count = int(segment_of_face.max(initial=0)) + 1
    cell = brep.of_triangle[known].astype(np.int64) * count + segment_of_face[known]
    area = np.bincount(cell, weights=mesh.face_areas_mm2()[known], minlength=len(brep.faces) * count)
    table = area.reshape(-1, count)
    return np.where(table.sum(axis=1) > 0, table.argmax(axis=1), NO_SEGMENT)
