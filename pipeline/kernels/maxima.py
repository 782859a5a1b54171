"""Ranking of the vertices by a scalar field on a surface: local maxima first, then all other vertices.

Fields are rounded to steps of 2^-40 of their largest magnitude, and equal values are ordered by index, so
that rounding errors in a flat region do not change the order when the part is rotated.
"""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_matrix

from pipeline.core.mesh import BoolArray, FloatArray, IndexArray, IntArray
from pipeline.kernels import topology

#: Bits that remain of a field after rounding, relative to its largest magnitude. Derived: the step is larger
#: than the rounding error of the fields.
_FIELD_BITS = 40
#: Smallest magnitude of a field; avoids log 0.
_TINY = 1e-300


@dataclass(frozen=True, slots=True)
class Ranking:
    """vertex : (k,) index, best first; strength : (k,) no unit, decreasing"""

    vertex: IndexArray
    strength: FloatArray


@dataclass(frozen=True, slots=True)
class Neighbours:
    """Ordered pairs of neighbouring vertices, each pair in both orders. of, other : (k,), of != other"""

    of: IndexArray
    other: IndexArray


def ring(faces: IntArray, n: int, rings: int = 1) -> Neighbours:
    """Pairs of vertices at most `rings` edges apart. faces : (m, 3); n : number of vertices"""
    i, j = topology.edges(faces).ends.T
    step = csr_matrix((np.ones(2 * len(i)), (np.concatenate([i, j]), np.concatenate([j, i]))), shape=(n, n))
    reached = step
    for _ in range(rings - 1):
        reached = csr_matrix(reached + reached @ step)
    pairs = reached.tocoo()
    distinct = pairs.row != pairs.col
    return Neighbours(pairs.row[distinct].astype(np.int64), pairs.col[distinct].astype(np.int64))


def local_maxima(field: FloatArray, near: Neighbours) -> BoolArray:
    """(n,) whether the vertex is a local maximum: no neighbour is larger, and at least one is smaller.

    field : (n,). Among equal neighbours only the smallest index is a maximum. Vertices where the field is
    -inf and vertices without neighbours are no maxima.
    """
    field = stepped(field)
    rank = np.zeros(len(field), dtype=np.int64)
    rank[np.argsort(-field, kind="stable")] = np.arange(len(field))[::-1]
    highest_neighbour = np.full(len(field), -1, dtype=np.int64)
    np.maximum.at(highest_neighbour, near.of, rank[near.other])
    has_lower = np.zeros(len(field), dtype=np.bool_)
    other = field[near.other]
    has_lower[near.of[(field[near.of] > other) & np.isfinite(other)]] = True
    is_maximum: BoolArray = has_lower & (rank > highest_neighbour)
    return is_maximum


def stepped(field: FloatArray) -> FloatArray:
    """The field (n,) rounded to 2^-40 of its largest magnitude; -inf is kept."""
    size = float(np.max(np.abs(field[np.isfinite(field)]), initial=0.0))
    unit = float(2.0 ** (np.ceil(np.log2(max(size, _TINY))) - _FIELD_BITS))
    return np.asarray(np.round(field / unit) * unit, dtype=np.float64)


def ranked(field: FloatArray, tops: BoolArray) -> Ranking:
    """Local maxima `tops` (n,) by decreasing `field` (n,), then all other vertices by decreasing field.

    Vertices where the field is -inf are omitted. The strength is half of the field normalised to [0, 1], plus
    1 at a maximum.
    """
    return coarse_to_fine(field[:, None], tops[:, None])


def coarse_to_fine(fields: FloatArray, tops: BoolArray) -> Ranking:
    """Ranking over s scales: maxima of the first (coarsest) field, further maxima of the second, and so on.

    fields, tops : (n, s). The remaining vertices follow by the last field. The strength is the number of
    scales from the last one to the first at which the vertex is a maximum, plus half of the field at that
    scale, normalised to [0, 1].
    """
    scales = fields.shape[1]
    fields = np.stack([stepped(field) for field in fields.T], axis=1)
    usable = np.flatnonzero(np.isfinite(fields).all(axis=1))
    if len(usable) == 0:
        return Ranking(np.zeros(0, dtype=np.int64), np.zeros(0))
    first = np.where(tops.any(axis=1), tops.argmax(axis=1), scales)[usable]
    column = np.minimum(first, scales - 1)
    value = fields[usable, column]
    low, high = fields[usable].min(axis=0), fields[usable].max(axis=0)
    span = np.where(high > low, high - low, 1.0)
    strength = (scales - first) + 0.5 * (value - low[column]) / span[column]
    order = np.lexsort((usable, -value, first))
    return Ranking(usable[order], np.asarray(strength[order], dtype=np.float64))


def by_turn(vertex: IndexArray) -> Ranking:
    """Ranking in the order of `vertex` (k,), for orders without a natural strength: 1, 1/2, 1/3, ..."""
    position = np.arange(1, len(vertex) + 1, dtype=np.float64)
    return Ranking(vertex, 1.0 / position)
