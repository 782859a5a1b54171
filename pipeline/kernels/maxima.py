"""Vertices in the order of a field on a surface: its local maxima first, then everything else.

Fields are compared in steps of 2^-40 of their size, and equal values go by index: where a field is flat,
turning the part must not reorder its rounding errors.
"""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_matrix

from pipeline.core.mesh import BoolArray, FloatArray, IndexArray, IntArray
from pipeline.kernels import topology


@dataclass(frozen=True, slots=True)
class Ranking:
    """vertex : (k,) best first; strength : (k,) without unit, falling"""

    vertex: IndexArray
    strength: FloatArray


@dataclass(frozen=True, slots=True)
class Neighbours:
    """Pairs of vertices near each other, both ways round. of, other : (k,), of != other"""

    of: IndexArray
    other: IndexArray


def ring(faces: IntArray, n: int, rings: int = 1) -> Neighbours:
    """Vertices at most so many edges apart."""
    i, j = topology.edges(faces).ends.T
    step = csr_matrix((np.ones(2 * len(i)), (np.concatenate([i, j]), np.concatenate([j, i]))), shape=(n, n))
    reached = step
    for _ in range(rings - 1):
        reached = csr_matrix(reached + reached @ step)
    pairs = reached.tocoo()
    apart = pairs.row != pairs.col
    return Neighbours(pairs.row[apart].astype(np.int64), pairs.col[apart].astype(np.int64))


def local_maxima(field: FloatArray, near: Neighbours) -> BoolArray:
    """(n,) whether no neighbour's value is larger and one is smaller; of equal neighbours the smaller index
    counts.

    Never where the field is -inf, nor at a vertex without neighbours.
    """
    field = stepped(field)
    standing = np.zeros(len(field), dtype=np.int64)
    standing[np.argsort(-field, kind="stable")] = np.arange(len(field))[::-1]
    highest = np.full(len(field), -1, dtype=np.int64)
    np.maximum.at(highest, near.of, standing[near.other])
    above = np.zeros(len(field), dtype=np.bool_)
    lower = field[near.other]
    above[near.of[(field[near.of] > lower) & np.isfinite(lower)]] = True
    top: BoolArray = above & (standing > highest)
    return top


def stepped(field: FloatArray) -> FloatArray:
    """The field rounded to 2^-40 of its largest magnitude; -inf stays."""
    size = float(np.max(np.abs(field[np.isfinite(field)]), initial=0.0))
    unit = float(2.0 ** (np.ceil(np.log2(max(size, 1e-300))) - 40))
    return np.asarray(np.round(field / unit) * unit, dtype=np.float64)


def ranked(field: FloatArray, tops: BoolArray) -> Ranking:
    """`tops` by the field, then all other vertices by the field; without those where it is -inf.

    field : (n,); tops : (n,). Strength is the field from least (0) to greatest (1), half of it, and one more
    at a top.
    """
    return coarse_to_fine(field[:, None], tops[:, None])


def coarse_to_fine(fields: FloatArray, tops: BoolArray) -> Ranking:
    """The same over scales: tops of the first (coarsest) field, tops that the second adds, ..., the rest by
    the last.

    fields, tops : (n, s). Strength is the number of scales from the last to the one where the vertex is first
    a top, plus half of the field there, from least (0) to greatest (1).
    """
    scales = fields.shape[1]
    fields = np.stack([stepped(field) for field in fields.T], axis=1)
    usable = np.flatnonzero(np.isfinite(fields).all(axis=1))
    if len(usable) == 0:
        return Ranking(np.zeros(0, dtype=np.int64), np.zeros(0))
    first = np.where(tops.any(axis=1), tops.argmax(axis=1), scales)[usable]
    column = np.minimum(first, scales - 1)
    value = fields[usable, column]
    least, greatest = fields[usable].min(axis=0), fields[usable].max(axis=0)
    span = np.where(greatest > least, greatest - least, 1.0)
    strength = (scales - first) + 0.5 * (value - least[column]) / span[column]
    order = np.lexsort((usable, -value, first))
    return Ranking(usable[order], np.asarray(strength[order], dtype=np.float64))


def by_turn(vertex: IndexArray) -> Ranking:
    """An order that has no natural strength: 1, 1/2, 1/3, ..."""
    turn = np.arange(1, len(vertex) + 1, dtype=np.float64)
    return Ranking(vertex, 1.0 / turn)
