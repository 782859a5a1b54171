"""Isotropic remeshing: the same surface in nearly equilateral triangles of one size (`native/remesher.hpp`).

Botsch & Kobbelt, "A remeshing approach to multiresolution modeling" (2004). pymeshlab has the same method
(`remesh.isotropic`): it makes simulated scans, as another triangulation, and takes three to four times as
long.
"""

import os

import numpy as np

from pipeline.core.mesh import Mesh
from pipeline.kernels import remesh
from pipeline.kernels.native import core


def remeshed(mesh: Mesh, edge_mm: float, passes: int, *, crease_deg: float | None = None) -> Mesh:
    """The surface with edges of about `edge_mm`.

    Creases sharper than `crease_deg` are kept, by default those that the roughness of the mesh does not make,
    and open borders. Vertices lie on the given surface; those of creases and borders on their lines. Where
    triangles meet in a vertex without a common edge, each side has a copy of it. The same bytes with any
    number of threads.

    mesh : with at least one triangle; passes : of splitting, collapsing, flipping and relaxing
    """
    if crease_deg is None:
        crease_deg = remesh.crease_deg(mesh)
    vertices, faces = core.isotropic(
        np.ascontiguousarray(mesh.vertices, dtype=np.float64),
        np.ascontiguousarray(mesh.faces, dtype=np.int32),
        edge_mm,
        crease_deg,
        passes,
        len(os.sched_getaffinity(0)),
    )
    return Mesh(np.asarray(vertices), np.asarray(faces))
