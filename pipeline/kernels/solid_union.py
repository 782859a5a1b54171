"""The union of closed bodies by Manifold (Lalish, github.com/elalish/manifold): one surface without the walls
between them. Double precision; the same bytes whatever the number of threads.
"""

from collections.abc import Sequence

import manifold3d
import numpy as np

from pipeline.core.mesh import FloatArray, IntArray, Mesh

#: Walls of bodies that touch are this far apart at most, as a share of the diagonal, where the file rounds
#: to single precision; bodies grow by that much where that makes them touch. Derived: 2^-24 for each of two
#: walls, with a margin. A part of 100 mm grows by 0.05 micrometres.
GAP_SHARE = 5e-7
#: The grown union is taken where it has less surface than the exact one, by more than this share. Derived:
#: growth by `GAP_SHARE` changes less.
LESS_AREA_SHARE = 1e-4


def united(bodies: Sequence[tuple[FloatArray, IntArray]], diagonal_mm: float) -> Mesh | None:
    """The union of bodies, each vertices (n, 3) and faces (m, 3) of closed shells with normals outwards (of
    cavities inwards); None when Manifold refuses one of them.

    diagonal_mm : of the part, which rounding is relative to
    """
    corners = np.stack([[vertices.min(axis=0), vertices.max(axis=0)] for vertices, _ in bodies])
    centre = (corners[:, 0].min(axis=0) + corners[:, 1].max(axis=0)) / 2  # rounding is relative to the origin
    bodies = [(vertices - centre, faces) for vertices, faces in bodies]
    exact = _union(bodies)
    gap_mm = GAP_SHARE * diagonal_mm
    grown = _union([(_grown(vertices, faces, gap_mm), faces) for vertices, faces in bodies])
    if exact is None:
        return None
    if grown is not None and grown.surface_area() < (1.0 - LESS_AREA_SHARE) * exact.surface_area():
        exact = grown
    mesh = exact.to_mesh64()  # not `simplify`: version 3.5.4 moves surfaces by more than its tolerance
    vertices, faces = np.asarray(mesh.vert_properties)[:, :3], np.asarray(mesh.tri_verts).astype(np.int32)
    return Mesh(vertices + centre, faces)


def _union(bodies: Sequence[tuple[FloatArray, IntArray]]) -> manifold3d.Manifold | None:
    solids = [
        manifold3d.Manifold(
            manifold3d.Mesh64(np.ascontiguousarray(vertices), np.ascontiguousarray(faces, dtype=np.uint64))
        )
        for vertices, faces in bodies
    ]
    if any(solid.status() != manifold3d.Error.NoError or solid.is_empty() for solid in solids):
        return None
    union = manifold3d.Manifold.batch_boolean(solids, manifold3d.OpType.Add)
    return union if union.status() == manifold3d.Error.NoError and not union.is_empty() else None


def _grown(vertices: FloatArray, faces: IntArray, by_mm: float) -> FloatArray:
    """Each vertex moved outwards along its normal."""
    return vertices + by_mm * Mesh(vertices, faces).vertex_normals()
