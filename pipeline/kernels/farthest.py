"""Geodesic farthest-point sampling: the next sample is the vertex farthest from all samples so far.

Eldar, Lindenbaum, Porat, Zeevi, "The farthest point strategy for progressive image sampling" (1997); on
surfaces Moenning & Dodgson (2003). The search from a new sample stops at the largest distance so far, so
later samples cost little.
"""

from dataclasses import dataclass

import numpy as np

from pipeline.core.mesh import BoolArray, FloatArray, IndexArray
from pipeline.kernels.geodesics import GeodesicSolver

#: Relative margin on the search radius: geodesic distances are exact up to rounding only. Derived from the
#: rounding of the geodesic solver, with reserve.
_ROUNDING_MARGIN = 1e-9


@dataclass(frozen=True, slots=True)
class Spread:
    """Result of the sampling.

    taken : (k,) vertex indices in the order of sampling; reach_mm : (k,) distance of each sample to the
    earlier ones, not increasing, inf for the first sample of a connected piece; distance_mm : (n,) distance
    of each vertex to the nearest sample
    """

    taken: IndexArray
    reach_mm: FloatArray
    distance_mm: FloatArray


def farthest_points(
    vertices: FloatArray, areas: FloatArray, solver: GeodesicSolver, count: int, usable: BoolArray
) -> Spread:
    """Sample at most `count` of the usable vertices; fewer if every usable vertex coincides with a sample.

    The first sample is the vertex with the largest Euclidean distance from the area centroid. Connected
    pieces are infinitely far from each other: each piece gets a first sample by the same rule, the largest
    piece first, before any piece gets a second one.

    vertices : (n, 3) mm; areas : (n,) mm^2, vertex areas; usable : (n,)
    """
    centroid = np.einsum("n,nd->d", areas, vertices) / max(float(areas.sum()), 1e-300)
    from_centroid = np.linalg.norm(vertices - centroid, axis=1)
    piece_area = np.bincount(solver.components, weights=areas)[solver.components]
    distance = np.full(len(vertices), np.inf)
    taken: list[int] = []
    reach: list[float] = []
    while len(taken) < count:
        reached = np.isfinite(distance)
        new = np.flatnonzero(usable & ~reached)
        if len(new):
            vertex = int(new[np.lexsort((new, -from_centroid[new], -piece_area[new]))[0]])
        else:
            vertex = int(np.where(usable, distance, -1.0).argmax())
        if not usable[vertex] or distance[vertex] == 0:
            break
        taken.append(vertex)
        reach.append(float(distance[vertex]))
        # A vertex beyond the current largest distance cannot become nearer.
        distance = np.minimum(distance, solver.distances(vertex, reach[-1] * (1 + _ROUNDING_MARGIN)))
    return Spread(np.array(taken, dtype=np.int64), np.array(reach), distance)
