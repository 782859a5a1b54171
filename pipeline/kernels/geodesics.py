"""Exact distances along a triangle surface, behind one class.

The search itself is C++ (`native/`): windows (Mitchell, Mount, Papadimitriou 1987; Surazhsky et al. 2005) in
one queue with the vertices, pruned by "one angle, one split" (Chen & Han 1990) and the filter of Xin & Wang
(2009). It needs edge lengths only, so any *intrinsic* metric will do, and stops at a radius or at the vertex
it was looking for, so density peaks never need all pairs: rho streams the balls, delta stops at the first
denser vertex, d_c looks at a narrow shell.

Distances are canonical: d(i, j) is the smaller of the two directions, which differ in the last bits; so every
answer here is the one that the full matrix of canonical distances gives, for any number of threads.
"""

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import overload

import numpy as np
import numpy.typing as npt
from scipy.sparse import csr_matrix

from pipeline.core.mesh import FloatArray, IndexArray, IntArray
from pipeline.kernels import topology
from pipeline.kernels.native import core

OnShare = Callable[
    [float], bool | None
]  # hears the share done; answering False stops the work with InterruptedError

_SLACK = 1e-9  # two directions of a pair differ by less than this, relatively
_SAMPLE = 256  # sources that d_c is first estimated from
GAUSSIAN_REACH = 3.0  # in d_c; at 2 the segments of teeth are already worse
_MAX_SHELLS = 300
_SHELL = 0.05  # and the half width of the shell it is then looked for in


class GeodesicSolver:
    """Shortest paths on one mesh: built once, asked often.

    vertices : (n, 3) mm; faces : (m, 3) in [0, n); lengths : (m, 3) of the edge opposite each corner, where
    the metric is not that of the vertices' positions (then these are not used); threads : default all this
    process may use. Open, non-manifold and degenerate meshes are fine; pieces are infinitely far from each
    other.
    """

    def __init__(
        self,
        vertices: FloatArray,
        faces: IntArray,
        *,
        lengths: FloatArray | None = None,
        threads: int | None = None,
        on_share: OnShare | None = None,
    ) -> None:
        self.n = len(vertices)
        self._threads = threads or len(os.sched_getaffinity(0))
        self._on_share = on_share
        lengths = edge_lengths(vertices, faces) if lengths is None else lengths
        whole = (faces != np.roll(faces, 1, axis=1)).all(
            axis=1
        )  # a face that names a vertex twice joins nothing
        faces, lengths = np.ascontiguousarray(faces[whole], dtype=np.int32), lengths[whole]
        self.components: IntArray = topology.vertex_components(faces, self.n)
        self._longest = float(lengths.max(initial=0.0))
        self._core = core.Solver(faces, np.ascontiguousarray(lengths, dtype=np.float64), self.n)

    @overload
    def distances(self, source: int, radius: float = ...) -> FloatArray: ...
    @overload
    def distances(self, source: Sequence[int] | IndexArray, radius: float = ...) -> FloatArray: ...

    def distances(self, source: int | Sequence[int] | IndexArray, radius: float = np.inf) -> FloatArray:
        """(n,) from one vertex to every vertex, or (k, n) from several; inf beyond `radius`. One direction
        only.

        Raises
        ------
        IndexError
            When a source is no vertex.
        """
        rows = np.asarray(self._core.distances(_sources(source), radius, self._threads, self._on_share))
        return rows[0] if np.ndim(source) == 0 else rows

    def distances_from_set(self, sources: IndexArray) -> FloatArray:
        """(n,) distance to the nearest of `sources`; inf everywhere when there are none."""
        return np.asarray(self._core.distances_from_set(_sources(sources), np.inf))

    def within(self, radius: float) -> csr_matrix:
        """(n, n) all pairs i != j with d(i, j) <= radius, as stored entries; symmetric to the last bit,
        sorted indices.

        A pair at distance 0 (two vertices in one place) is stored as an explicit 0.
        """
        counts, j, d = self._core.balls(
            np.arange(self.n), radius * (1 + _SLACK), self._threads, self._on_share
        )
        i = np.repeat(np.arange(self.n), counts)
        low, high, d, _ = _canonical(_column(i), _column(j), np.asarray(d), self.n)
        kept = d <= radius
        low, high, d = low[kept], high[kept], d[kept]
        rows, columns = np.concatenate([low, high]), np.concatenate([high, low])
        order = np.lexsort((columns, rows))
        indptr = np.concatenate([[0], np.cumsum(np.bincount(rows, minlength=self.n))])
        return csr_matrix((np.concatenate([d, d])[order], columns[order], indptr), shape=(self.n, self.n))

    def count_within(self, radius: float) -> IndexArray:
        """(n,) number of other vertices with d <= radius, streamed: memory is O(n)."""
        ones = np.ones(self.n)
        return self._pass(ones, radius * (1 - _SLACK), radius * (1 + _SLACK)).up_to(
            np.nextafter(radius, np.inf), ones
        )[0]

    def density(self, d_c: float, weights: FloatArray, *, gaussian: bool = False) -> FloatArray:
        """(n,) local density, streamed: memory is O(n) and never a matrix.

        Cut-off kernel: sum of `weights` over d(i, j) < d_c, the own weight included (Rodriguez & Laio 2014,
        eq. 1). Gaussian: the same with exp(-(d / d_c)^2), up to GAUSSIAN_REACH d_c. Densities are rounded to
        2^-40 of the largest, so that equal ones are equal whatever order they were added up in.
        """
        limit, scale = (GAUSSIAN_REACH * d_c, d_c) if gaussian else (d_c, 0.0)
        shell = self._pass(weights, limit * (1 - _SLACK), limit * (1 + _SLACK), scale)
        return rounded(shell.up_to(limit, weights, scale)[1] + weights)

    def nearest_denser(self, rho: FloatArray) -> tuple[IndexArray, FloatArray]:
        """For every vertex the nearest vertex that is denser, and the distance (Rodriguez & Laio 2014, eq.
        2).

        Denser is a larger `rho`, or the same with a smaller index, so every piece has exactly one vertex with
        nobody denser: index -1 and distance inf. Of equally near ones the smaller index is taken. Each search
        stops at the first denser vertex.
        """
        index = np.full(self.n, -1, dtype=np.int64)
        distance = np.full(self.n, np.inf)
        rank = density_rank(rho)
        _, first_of_piece = np.unique(self.components[np.argsort(rank)], return_index=True)
        peaks = np.argsort(rank)[
            first_of_piece
        ]  # nobody is denser: a search would go through the whole piece
        climbing = np.setdiff1d(np.arange(self.n), peaks)
        counts, found, d = self._core.nearest_denser(climbing, rank, _SLACK, self._threads, self._on_share)
        i, j = _column(np.repeat(climbing, counts)), _column(found)
        d = np.minimum(d, self._core.between(j, i, d * (1 + _SLACK), self._threads, self._on_share))
        order = np.lexsort((j, d, i))
        first = order[np.unique(i[order], return_index=True)[1]]
        index[i[first]], distance[i[first]] = j[first], d[first]
        return index, distance

    def nearest_other(self, sources: IndexArray, labels: IntArray, radius: float) -> FloatArray:
        """(k,) for each source the distance to the nearest vertex of another label >= 0; inf when none is
        nearer than `radius`.
        """
        labels = np.ascontiguousarray(labels, dtype=np.int32)
        limit = radius * (1 + _SLACK)
        counts, other, d = self._core.nearest_other(
            _sources(sources), labels, limit, _SLACK, self._threads, self._on_share
        )
        i, j = _column(np.repeat(np.arange(len(sources)), counts)), _column(other)
        d = np.minimum(
            d, self._core.between(j, _sources(sources)[i], d * (1 + _SLACK), self._threads, self._on_share)
        )
        nearest = np.full(len(sources), np.inf)
        np.minimum.at(nearest, i, d)
        return np.asarray(np.where(nearest < radius, nearest, np.inf))

    def quantile(self, q: float) -> float:
        """d_c: the max(1, round(q N))-th smallest of the N = n (n - 1) / 2 pairwise distances, exactly.

        Pairs on different pieces come last, as inf. No n x n array: an estimate from a few sources, then the
        pairs in a narrow shell around it one by one, and those nearer by their number.
        """
        return self.cutoff_density(q, np.ones(self.n))[0]

    def cutoff_density(self, q: float, weights: FloatArray) -> tuple[float, FloatArray]:
        """`d_c = quantile(q)` and `density(d_c, weights)` from one pass over the balls; (inf, all weights)
        without enough pairs.
        """
        k = max(1, round(q * (self.n * (self.n - 1) // 2)))
        sizes = np.bincount(self.components)
        if k > int((sizes * (sizes - 1) // 2).sum()):
            return float("inf"), rounded(
                np.bincount(self.components, weights).astype(np.float64)[self.components]
            )
        estimate = self._estimate(k)
        floor = 1e-9 * estimate
        low, high = estimate * (1 - _SHELL), estimate * (1 + _SHELL)
        for _ in range(_MAX_SHELLS):
            shell = self._pass(weights, low * (1 - _SLACK), high * (1 + _SLACK))
            # A pair at the inner limit may be in the shell from one end and nearer from the other, by
            # rounding.
            split = int(((shell.times == 1) & (shell.d < low * (1 - _SLACK / 2))).sum())
            nearer = (int(shell.counts.sum()) - split) // 2
            inside = np.sort(shell.d[shell.d <= high])
            if k <= nearer:
                low, high = (low * 0.8 if low > floor else 0.0), low
            elif k > nearer + len(inside):
                low, high = high, high * 1.25
            else:
                d_c = float(inside[k - nearer - 1])
                return d_c, rounded(shell.up_to(d_c, weights)[1] + weights)
        d_c = self._quantile_by_counts(k)
        return d_c, self.density(d_c, weights)

    def _quantile_by_counts(self, k: int) -> float:
        """The smallest radius that holds k pairs, to rounding, by bisection.

        For meshes so degenerate (lengths of 1e-9 beside 1e6) that the two directions of a pair differ by more
        than rounding.
        """
        low, high = 0.0, self._longest
        while int(self.count_within(high).sum()) < 2 * k and high < 1e300:
            high *= 2.0
        for _ in range(100):
            middle = (low + high) / 2
            low, high = (low, middle) if int(self.count_within(middle).sum()) >= 2 * k else (middle, high)
        return high

    def _estimate(self, k: int) -> float:
        """About the k-th smallest distance, from the nearest vertices of some sources."""
        sources = np.unique(np.linspace(0, self.n - 1, min(self.n, _SAMPLE)).astype(np.int64))
        a_source = 2.0 * k / self.n  # so many pairs a vertex, from both ends
        most = int(min(self.n - 1, np.ceil(3 * a_source) + 10))
        found = np.sort(np.asarray(self._core.nearest(sources, most, self._threads)).ravel())
        found = found[np.isfinite(found)]
        guess = float(found[min(len(found) - 1, int(a_source * len(sources)))]) if found.size else 0.0
        return max(guess, 1e-9 * self._longest, 1e-300)  # vertices in one place, or lonely sources

    def _pass(self, weights: FloatArray, low: float, high: float, scale: float = 0.0) -> "_Shell":
        """One search a vertex, out to `high`: what is nearer than `low` added up, the shell between them pair
        by pair.
        """
        weights = np.ascontiguousarray(weights, dtype=np.float64)
        counts, sums, i, j, d = self._core.sums(weights, low, high, scale, self._threads, self._on_share)
        first, second, d, times = _canonical(_column(i), _column(j), np.asarray(d), self.n)
        return _Shell(np.array(counts), np.array(sums), first, second, np.asarray(d), times)


@dataclass(frozen=True, slots=True)
class _Shell:
    """counts, sums : (n,) vertices nearer than the shell, and their weights; first, second, d, times : (k,)
    the pairs in it, each once, with the canonical distance and from how many ends they were found there
    """

    counts: IndexArray
    sums: FloatArray
    first: IndexArray
    second: IndexArray
    d: FloatArray
    times: IndexArray

    def up_to(self, limit: float, weights: FloatArray, scale: float = 0.0) -> tuple[IndexArray, FloatArray]:
        """Number and summed weights (times exp(-(d / scale)^2) when scale > 0) of the vertices with d <
        limit.
        """
        counts, sums, inside = self.counts.copy(), self.sums.copy(), self.d < limit
        first, second, d = self.first[inside], self.second[inside], self.d[inside]
        kernel = np.exp(-((d / scale) ** 2)) if scale > 0 else np.ones(len(d))
        for here, there in ((first, second), (second, first)):
            np.add.at(counts, here, 1)
            np.add.at(sums, here, weights[there] * kernel)
        return counts, sums


def edge_lengths(vertices: FloatArray, faces: IntArray) -> FloatArray:
    """(m, 3) length of the edge opposite each corner."""
    corners = vertices[faces]
    return np.asarray(np.linalg.norm(np.roll(corners, 1, axis=1) - np.roll(corners, -1, axis=1), axis=2))


def density_rank(rho: FloatArray) -> IndexArray:
    """(n,) 0 for the densest; equal densities rank by index."""
    rank = np.zeros(len(rho), dtype=np.int64)
    rank[np.argsort(-rho, kind="stable")] = np.arange(len(rho))
    return rank


def rounded(rho: FloatArray) -> FloatArray:
    """Densities to 2^-40 of the largest: sums of the same terms in another order become equal."""
    unit = float(2.0 ** (np.ceil(np.log2(max(float(np.max(rho, initial=0.0)), 1e-300))) - 40))
    return np.asarray(np.round(rho / unit) * unit, dtype=np.float64)


def _sources(given: int | Sequence[int] | IndexArray) -> IndexArray:
    return np.ascontiguousarray(np.atleast_1d(np.asarray(given, dtype=np.int64)))


def _column(values: npt.ArrayLike) -> IndexArray:
    return np.ascontiguousarray(values, dtype=np.int64)


def _canonical(
    i: IndexArray, j: IndexArray, d: FloatArray, n: int
) -> tuple[IndexArray, IndexArray, FloatArray, IndexArray]:
    """Directed pairs as undirected ones: smaller index, larger index, the smaller distance, how often found
    (1, 2).
    """
    keys = np.minimum(i, j) * n + np.maximum(i, j)
    order = np.lexsort((d, keys))
    unique, first, times = np.unique(keys[order], return_index=True, return_counts=True)
    return unique // n, unique % n, d[order[first]], times
