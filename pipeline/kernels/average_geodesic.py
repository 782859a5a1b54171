"""Average geodesic distance: how far a point is from the rest of its surface. Large at tips, small in the
middle.

Hilaga, Shinagawa, Kohmura, Kunii, "Topology matching for fully automatic similarity estimation of 3D shapes"
(2001); its maxima as feature points: Zhang, Mischaikow, Turk, "Feature-based surface parameterization and
texture mapping" (2005). As in Hilaga et al., who take about as many, the integral is a sum over base points
that each stand for the surface nearest to them. Against the sum over all vertices (40 to 60 s) on three parts
of 4,500 vertices that was right to 0.5 %, with all of its local maxima and at most one more.
"""

import numpy as np

from pipeline.core.mesh import FloatArray
from pipeline.kernels import sampling
from pipeline.kernels.geodesics import GeodesicSolver

BASES = 160  # on the whole mesh; a piece gets its share of the area


def average_geodesic(
    vertices: FloatArray, areas: FloatArray, solver: GeodesicSolver, bases: int = BASES
) -> FloatArray:
    """(n,) mm, area-weighted mean distance to the own connected piece.

    vertices : (n, 3) mm; areas : (n,) mm^2 of the vertices; bases : evenly spread (farthest-point) sources in
    all.
    """
    average = np.zeros(len(vertices))
    share = bases / max(float(areas.sum()), 1e-300)
    by_piece = np.argsort(solver.components, kind="stable")
    for members in np.split(by_piece, np.flatnonzero(np.diff(solver.components[by_piece])) + 1):
        area = float(areas[members].sum())
        if area == 0:
            continue
        count = int(np.ceil(share * area))
        sources = members[sampling.farthest(vertices[members], count)]
        distance = solver.distances(sources)[:, members]
        weights = np.bincount(distance.argmin(axis=0), weights=areas[members], minlength=len(sources)) / area
        average[members] = np.einsum("k,kn->n", weights, distance)
    return average
