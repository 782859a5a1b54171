"""Specks near the part in a point cloud: few points that are one another's nearest, apart from all others.

The pieces of a cloud (`kernels.pieces`) bridge gaps of several spacings, as scanners leave some; a speck that
is nearer than that belongs to the piece of the part, and is found here.
"""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_matrix, csgraph

from pipeline.core.mesh import BoolArray, IntArray, Mesh
from pipeline.kernels.nearest import k_nearest, nearest
from pipeline.kernels.pieces import Pieces

#: Nearest neighbours that hang together with a point: a speck of fewer points stays, as it weighs nothing.
NEIGHBOURS = 6
#: Points among which specks are looked for, about; of a larger cloud every k-th. Chosen by hand, for time.
MAX_POINTS = 100_000
#: A speck holds at most the first share of the points, its box has at most the second of the diagonal of the
#: part, and all of them hold at most the third share: more are a part in pieces. Chosen by hand.
MAX_SHARE, MAX_SIZE, MAX_TOTAL = 0.01, 0.04, 0.05
#: Distance of a speck from all else, at least, in median distances of a point from its nearest: beyond what
#: an uneven scan leaves. Chosen by hand.
MIN_SPACINGS = 1.5


@dataclass(frozen=True, slots=True)
class NearSpecks:
    """is_speck : (n,) of the points of a cloud; of_point : (n,) number of the speck, 0 of the others"""

    is_speck: BoolArray
    of_point: IntArray

    def numbers(self, of_vertex: IntArray) -> IntArray:
        """(n,) the pieces `of_vertex` (n,) with each speck as a piece of its own, without a gap."""
        both = np.where(self.is_speck, of_vertex.max() + self.of_point, of_vertex)
        return np.asarray(np.unique(both, return_inverse=True)[1], dtype=np.int32)


def near_specks(mesh: Mesh, chosen: BoolArray, apart_mm: float) -> NearSpecks | None:
    """Of the `chosen` points (n,) of a cloud those in specks at least `apart_mm` from all else; None without
    any.
    """
    rows = np.flatnonzero(chosen)
    some = rows[:: -(-len(rows) // MAX_POINTS)]
    if len(some) <= NEIGHBOURS + 1:
        return None
    points = mesh.vertices[some]
    index = k_nearest(points, points, NEIGHBOURS + 1)
    count = len(points)
    pairs = (np.repeat(np.arange(count), NEIGHBOURS), index[:, 1:].ravel())
    graph = coo_matrix((np.ones(len(pairs[0]), dtype=np.int8), pairs), shape=(count, count))
    found, fragment = csgraph.connected_components(graph, directed=False)
    if found == 1:
        return None
    fragments = Pieces.numbered(Mesh(points), fragment)
    share = fragments.weight / fragments.weight.sum()
    size = fragments.diagonals_mm() / float(np.linalg.norm(np.ptp(points, axis=0)))
    small = (share <= MAX_SHARE) & (size <= MAX_SIZE)
    if not small.any() or float(share[small].sum()) > MAX_TOTAL:
        return None
    of_small = small[fragment]
    gap_mm = np.full(found, np.inf)
    to_rest, _ = nearest(points[~of_small], points[of_small])
    np.minimum.at(gap_mm, fragment[of_small], to_rest)
    spacing_mm = float(np.median(np.linalg.norm(points[index[:, 1]] - points, axis=1)))
    specks = small & (gap_mm > max(apart_mm, MIN_SPACINGS * spacing_mm))
    if not specks.any():
        return None
    number = np.zeros(found, dtype=np.int32)
    number[specks] = np.arange(1, int(specks.sum()) + 1)
    of_point = np.zeros(len(mesh.vertices), dtype=np.int32)
    all_looked_at = len(some) == len(rows)
    sample = np.arange(count) if all_looked_at else nearest(points, mesh.vertices[rows])[1]
    of_point[rows] = number[fragment[sample]]
    return NearSpecks(of_point > 0, of_point)
