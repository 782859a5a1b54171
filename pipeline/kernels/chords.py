"""Chords: what a triangle leaves out between its corners.

The corners of a triangle are points of the part. Between them it is a chord: over a fissure it lies outside
the part, below a crest inside, by as much as its length and more where the surface is steep. A face of the
part that is flat is exact between its corners too; it is told by triangles that lie in one plane with a
neighbour.
"""

from dataclasses import dataclass

import numpy as np

from pipeline.core.mesh import BoolArray, FloatArray, IndexArray, Mesh
from pipeline.kernels import topology

#: Degrees between the normals of two neighbours that are one flat face. Chosen by hand: rounding of a CAD
#: file leaves less, neighbours on a curved surface seldom do.
FLAT_DEG = 0.3
#: Depth of a fissure, or height of a crest, over the longest edge of the triangle that cuts it off: walls of
#: 76 degrees. Set on formula arches of seeds 1000 to 1003, where it reaches 1.2.
MAX_DEPTH_RATIO = 2.0


@dataclass(frozen=True, slots=True, eq=False)
class Chords:
    """is_chord : (m,) whether the triangle lies in one plane with none of its neighbours; longest_mm : (m,)
    its longest edge
    """

    is_chord: BoolArray
    longest_mm: FloatArray

    @classmethod
    def of(cls, mesh: Mesh, edges: topology.Edges) -> "Chords":
        """edges : of the mesh"""
        corners = mesh.vertices[mesh.faces]
        longest_mm = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
        cross = mesh.face_cross_mm2()
        normals = cross / np.maximum(np.linalg.norm(cross, axis=1, keepdims=True), 1e-300)
        of_edge = edges.of_face.ravel()
        order = np.argsort(of_edge, kind="stable")
        first = np.flatnonzero(edges.count[of_edge[order]] == 2)[::2]  # both triangles of an edge in a row
        a, b = order[first] // 3, order[first + 1] // 3
        is_flat = np.einsum("kd,kd->k", normals[a], normals[b]) >= np.cos(np.radians(FLAT_DEG))
        is_chord = np.ones(len(mesh.faces), dtype=np.bool_)
        is_chord[a[is_flat]] = False
        is_chord[b[is_flat]] = False
        return cls(is_chord, longest_mm)

    def may_explain(self, face: IndexArray, distance_mm: FloatArray) -> BoolArray:
        """(k,) whether the triangle `face` (k,) is a chord, and long enough for a distance (k,) to it."""
        return self.is_chord[face] & (distance_mm <= MAX_DEPTH_RATIO * self.longest_mm[face])
