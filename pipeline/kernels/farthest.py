"""Geodesic farthest-point sampling: each next point is the farthest from those taken.

Eldar, Lindenbaum, Porat, Zeevi, "The farthest point strategy for progressive image sampling" (1997); on
surfaces Moenning & Dodgson (2003). Each new source is searched no farther than the present largest distance,
so that later ones cost little.
"""

from dataclasses import dataclass

import numpy as np

from pipeline.core.mesh import BoolArray, FloatArray, IndexArray
from pipeline.kernels.geodesics import GeodesicSolver


@dataclass(frozen=True, slots=True)
class Spread:
    """taken : (k,) in order; reach_mm : (k,) distance of each to those before it, not rising; inf where a
    piece of the surface is new; distance_mm : (n,) to the nearest taken one
    """

    taken: IndexArray
    reach_mm: FloatArray
    distance_mm: FloatArray


def farthest_points(
    vertices: FloatArray, areas: FloatArray, solver: GeodesicSolver, count: int, usable: BoolArray
) -> Spread:
    """At most `count` of the usable vertices, fewer when all of them lie on taken ones.

    The first is the one farthest (straight) from the area centroid. Pieces are infinitely far from each
    other: each gets its first point, found in the same way, the largest piece first, before any gets a
    second.

    vertices : (n, 3) mm; areas : (n,) mm^2; usable : (n,).
    """
    centroid = np.einsum("n,nd->d", areas, vertices) / max(float(areas.sum()), 1e-300)
    outside = np.linalg.norm(vertices - centroid, axis=1)
    piece_area = np.bincount(solver.components, weights=areas)[solver.components]
    distance = np.full(len(vertices), np.inf)
    taken: list[int] = []
    reach: list[float] = []
    while len(taken) < count:
        reached = np.isfinite(distance)
        new = np.flatnonzero(usable & ~reached)
        if len(new):
            vertex = int(new[np.lexsort((new, -outside[new], -piece_area[new]))[0]])
        else:
            vertex = int(np.where(usable, distance, -1.0).argmax())
        if not usable[vertex] or distance[vertex] == 0:
            break
        taken.append(vertex)
        reach.append(float(distance[vertex]))
        # Farther than the farthest vertex nothing can come nearer. 1e-9: distances are right to rounding
        # only.
        distance = np.minimum(distance, solver.distances(vertex, reach[-1] * (1 + 1e-9)))
    return Spread(np.array(taken, dtype=np.int64), np.array(reach), distance)
