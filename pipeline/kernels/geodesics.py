"""Exact geodesic distances on a triangle mesh.

The search is C++ (`native/window_search.hpp`): window propagation (Mitchell, Mount, Papadimitriou 1987;
Surazhsky et al. 2005) in buckets of distance, pruned by "one angle, one split" (Chen & Han
1990) and the filter of Xin & Wang (2009). It needs edge lengths only, so any *intrinsic* metric can be used.
A search stops at a radius or at the target vertex, so density peaks never need all pairs: rho visits each
ball once, delta stops at the first denser vertex, and d_c examines a narrow shell of distances.

The distances found from i and from j differ in the last bits. The canonical distance d(i, j) is the smaller
of the two. Every result of this module equals the one from the full matrix of canonical distances, for any
number of threads; only `distances` and `distances_from_set` use one direction.
"""

import os
from collections.abc import Callable, Sequence
from typing import overload

import numpy as np
import numpy.typing as npt
from scipy.sparse import csr_matrix

from pipeline.core.mesh import FloatArray, IndexArray, IntArray
from pipeline.kernels import topology
from pipeline.kernels.distance_shell import DistanceShell, canonical_pairs
from pipeline.kernels.native import core

#: Progress callback, called with the share done in [0, 1]; returning False stops the work with
#: InterruptedError.
OnShare = Callable[[float], bool | None]

#: Reach of the Gaussian kernel, in d_c, where exp(-9) = 1e-4 of its weight remains. Chosen by hand: with 2
#: the segments of teeth are worse.
GAUSSIAN_REACH = 3.0
#: Relative difference between the two directions of a pair, at most. Derived from rounding, with reserve.
_SLACK = 1e-9
#: Sources of the first estimate of d_c. Affects only the time. Chosen by hand, not fitted.
_SAMPLE = 256
#: Half width of the first shell around the estimate of d_c, relative. Affects only the time. Chosen by hand.
_SHELL = 0.05
#: Factors by which a shell that misses d_c moves inwards and outwards. Affect only the time. Chosen by hand.
_SHELL_INWARDS, _SHELL_OUTWARDS = 0.8, 1.25
#: Shells tried before the bisection by counts, at most. Chosen by hand, not fitted.
_MAX_SHELLS = 300
#: Steps of that bisection, more than the bits of a float64 mantissa. Derived.
_BISECTIONS = 100
#: Upper limit of its radius, below the overflow of float64.
_MAX_RADIUS = 1e300
#: Smallest d_c as a share of the longest edge (first estimate) or of the estimate (a shell). By hand, not
#: fitted.
_MIN_SHARE = 1e-9
#: Nearest vertices per source in the first estimate: this multiple of the expected number, plus an offset.
#: Affect only the time. Chosen by hand, not fitted.
_ESTIMATE_FACTOR, _ESTIMATE_EXTRA = 3, 10
#: Bits that remain of a density after rounding, relative to the largest density. Derived: the step is
#: larger than the rounding error of a sum in a different order.
_DENSITY_BITS = 40
#: Smallest positive scale; avoids log 0 and a radius of 0.
_TINY = 1e-300


class GeodesicSolver:
    """Geodesic distances on one mesh: built once, used for many queries.

    vertices : (n, 3) mm; faces : (m, 3) in [0, n); lengths : (m, 3) mm, length of the edge opposite each
    corner; if present, the positions are not used; threads : number of threads, by default all that this
    process may use; on_share : progress callback of every query. Open, non-manifold and degenerate meshes are
    allowed; connected pieces are infinitely far from each other.

    A query raises InterruptedError when `on_share` returns False.
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
        has_three_vertices = (faces != np.roll(faces, 1, axis=1)).all(axis=1)
        faces = np.ascontiguousarray(faces[has_three_vertices], dtype=np.int32)
        lengths = lengths[has_three_vertices]
        self.components: IntArray = topology.vertex_components(faces, self.n)
        self._longest = float(lengths.max(initial=0.0))
        self._core = core.Solver(faces, np.ascontiguousarray(lengths, dtype=np.float64), self.n)

    @overload
    def distances(self, source: int, radius: float = ...) -> FloatArray: ...
    @overload
    def distances(self, source: Sequence[int] | IndexArray, radius: float = ...) -> FloatArray: ...

    def distances(self, source: int | Sequence[int] | IndexArray, radius: float = np.inf) -> FloatArray:
        """(n,) mm from one vertex to every vertex, or (k, n) from k vertices; inf beyond `radius` (mm).

        The distances are from source to vertex, not canonical.

        Raises
        ------
        IndexError
            When a source is not a vertex.
        """
        rows = np.asarray(self._core.distances(_sources(source), radius, self._threads, self._on_share))
        return rows[0] if np.ndim(source) == 0 else rows

    def distances_from_set(self, sources: IndexArray) -> FloatArray:
        """(n,) mm: distance to the nearest of `sources` (k,); inf if `sources` is empty."""
        return np.asarray(self._core.distances_from_set(_sources(sources), np.inf))

    def within(self, radius: float) -> csr_matrix:
        """(n, n) distances in mm of all pairs i != j with d(i, j) <= radius (mm), as stored entries.

        Exactly symmetric, with sorted indices. A pair of coincident vertices is stored as an explicit 0.
        """
        counts, j, d = self._core.balls(
            np.arange(self.n), radius * (1 + _SLACK), self._threads, self._on_share
        )
        i = np.repeat(np.arange(self.n), counts)
        low, high, d, _ = canonical_pairs(_column(i), _column(j), np.asarray(d), self.n)
        inside = d <= radius
        low, high, d = low[inside], high[inside], d[inside]
        rows, columns = np.concatenate([low, high]), np.concatenate([high, low])
        order = np.lexsort((columns, rows))
        indptr = np.concatenate([[0], np.cumsum(np.bincount(rows, minlength=self.n))])
        return csr_matrix((np.concatenate([d, d])[order], columns[order], indptr), shape=(self.n, self.n))

    def count_within(self, radius: float) -> IndexArray:
        """(n,) number of other vertices with d <= radius (mm), in O(n) memory."""
        ones = np.ones(self.n)
        return self._pass(ones, radius * (1 - _SLACK), radius * (1 + _SLACK)).up_to(
            np.nextafter(radius, np.inf), ones
        )[0]

    def density(self, d_c: float, weights: FloatArray, *, gaussian: bool = False) -> FloatArray:
        """(n,) local density rho in the unit of `weights` (n,), in O(n) memory.

        Cut-off kernel: sum of `weights` over d(i, j) < d_c (mm), including the own weight (Rodriguez & Laio
        2014, eq. 1). Gaussian kernel: the same sum with the factor exp(-(d / d_c)^2), up to GAUSSIAN_REACH
        d_c. Densities are rounded to 2^-40 of the largest, so equal densities do not differ by the order of
        summation.
        """
        limit, scale = (GAUSSIAN_REACH * d_c, d_c) if gaussian else (d_c, 0.0)
        shell = self._pass(weights, limit * (1 - _SLACK), limit * (1 + _SLACK), scale)
        return rounded(shell.up_to(limit, weights, scale)[1] + weights)

    def nearest_denser(self, rho: FloatArray) -> tuple[IndexArray, FloatArray]:
        """(n,) index of the nearest denser vertex, and (n,) its distance delta, mm (Rodriguez & Laio 2014,
        eq. 2).

        A vertex is denser if its `rho` (n,) is larger, or equal with a smaller index. The densest vertex of
        each connected piece has index -1 and distance inf. Among equally near vertices the smaller index is
        taken. Each search stops at the first denser vertex.
        """
        index = np.full(self.n, -1, dtype=np.int64)
        distance = np.full(self.n, np.inf)
        rank = density_rank(rho)
        _, first_of_piece = np.unique(self.components[np.argsort(rank)], return_index=True)
        # No search from the densest vertex of a piece: it would visit the whole piece in vain.
        densest = np.argsort(rank)[first_of_piece]
        others = np.setdiff1d(np.arange(self.n), densest)
        counts, denser, d = self._core.nearest_denser(others, rank, _SLACK, self._threads, self._on_share)
        i, j = _column(np.repeat(others, counts)), _column(denser)
        d = np.minimum(d, self._core.between(j, i, d * (1 + _SLACK), self._threads, self._on_share))
        order = np.lexsort((j, d, i))
        first = order[np.unique(i[order], return_index=True)[1]]
        index[i[first]], distance[i[first]] = j[first], d[first]
        return index, distance

    def nearest_other(self, sources: IndexArray, labels: IntArray, radius: float) -> FloatArray:
        """(k,) mm: for each source the distance to the nearest vertex with a different label >= 0.

        sources : (k,); labels : (n,); radius : mm. inf if no such vertex is nearer than `radius`.
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
        """d_c, mm: exactly the max(1, round(q N))-th smallest of the N = n (n - 1) / 2 pairwise distances.

        q : in [0, 1]. Pairs on different pieces come last, as inf. No n x n array: d_c is estimated from a
        few sources; the pairs in a narrow shell around the estimate are listed, and the nearer pairs only
        counted.
        """
        return self.cutoff_density(q, np.ones(self.n))[0]

    def cutoff_density(self, q: float, weights: FloatArray) -> tuple[float, FloatArray]:
        """`d_c = quantile(q)`, mm, and `density(d_c, weights)` (n,) from one pass over the balls.

        If the pieces have too few pairs, d_c is inf and the density is the total weight of the piece.
        """
        k = max(1, round(q * (self.n * (self.n - 1) // 2)))
        sizes = np.bincount(self.components)
        if k > int((sizes * (sizes - 1) // 2).sum()):
            return float("inf"), rounded(
                np.bincount(self.components, weights).astype(np.float64)[self.components]
            )
        estimate = self._estimate(k)
        floor = _MIN_SHARE * estimate
        low, high = estimate * (1 - _SHELL), estimate * (1 + _SHELL)
        for _ in range(_MAX_SHELLS):
            shell = self._pass(weights, low * (1 - _SLACK), high * (1 + _SLACK))
            # By rounding, a pair at the inner limit may be in the shell from one end and nearer from the
            # other.
            split = int(((shell.times == 1) & (shell.d < low * (1 - _SLACK / 2))).sum())
            nearer = (int(shell.counts.sum()) - split) // 2
            inside = np.sort(shell.d[shell.d <= high])
            if k <= nearer:
                low, high = (low * _SHELL_INWARDS if low > floor else 0.0), low
            elif k > nearer + len(inside):
                low, high = high, high * _SHELL_OUTWARDS
            else:
                d_c = float(inside[k - nearer - 1])
                return d_c, rounded(shell.up_to(d_c, weights)[1] + weights)
        d_c = self._quantile_by_counts(k)
        return d_c, self.density(d_c, weights)

    def _quantile_by_counts(self, k: int) -> float:
        """The smallest radius, mm, that contains k pairs, by bisection up to rounding.

        Needed only for meshes so degenerate (edges of 1e-9 beside 1e6) that the two directions of a pair
        differ by more than `_SLACK`.
        """
        low, high = 0.0, self._longest
        while int(self.count_within(high).sum()) < 2 * k and high < _MAX_RADIUS:
            high *= 2.0
        for _ in range(_BISECTIONS):
            middle = (low + high) / 2
            low, high = (low, middle) if int(self.count_within(middle).sum()) >= 2 * k else (middle, high)
        return high

    def _estimate(self, k: int) -> float:
        """Approximate k-th smallest distance, mm, from the nearest vertices of at most `_SAMPLE` sources."""
        sources = np.unique(np.linspace(0, self.n - 1, min(self.n, _SAMPLE)).astype(np.int64))
        per_source = 2.0 * k / self.n  # pairs per vertex, counted from both ends
        count = int(min(self.n - 1, np.ceil(_ESTIMATE_FACTOR * per_source) + _ESTIMATE_EXTRA))
        d = np.sort(np.asarray(self._core.nearest(sources, count, self._threads)).ravel())
        d = d[np.isfinite(d)]
        estimate = float(d[min(len(d) - 1, int(per_source * len(sources)))]) if d.size else 0.0
        return max(estimate, _MIN_SHARE * self._longest, _TINY)  # for coincident or isolated vertices

    def _pass(self, weights: FloatArray, low: float, high: float, scale: float = 0.0) -> DistanceShell:
        """One search per vertex out to `high`: nearer pairs than `low` are summed, the others listed."""
        weights = np.ascontiguousarray(weights, dtype=np.float64)
        counts, sums, i, j, d = self._core.sums(weights, low, high, scale, self._threads, self._on_share)
        first, second, d, times = canonical_pairs(_column(i), _column(j), np.asarray(d), self.n)
        return DistanceShell(np.array(counts), np.array(sums), first, second, np.asarray(d), times)


def edge_lengths(vertices: FloatArray, faces: IntArray) -> FloatArray:
    """(m, 3) mm: length of the edge opposite each corner. vertices : (n, 3) mm; faces : (m, 3)"""
    corners = vertices[faces]
    return np.asarray(np.linalg.norm(np.roll(corners, 1, axis=1) - np.roll(corners, -1, axis=1), axis=2))


def density_rank(rho: FloatArray) -> IndexArray:
    """(n,) rank by decreasing density, 0 for the densest; equal densities are ordered by index."""
    rank = np.zeros(len(rho), dtype=np.int64)
    rank[np.argsort(-rho, kind="stable")] = np.arange(len(rho))
    return rank


def rounded(rho: FloatArray) -> FloatArray:
    """Densities rounded to 2^-40 of the largest: sums of the same terms in a different order become equal."""
    unit = float(2.0 ** (np.ceil(np.log2(max(float(np.max(rho, initial=0.0)), _TINY))) - _DENSITY_BITS))
    return np.asarray(np.round(rho / unit) * unit, dtype=np.float64)


def _sources(sources: int | Sequence[int] | IndexArray) -> IndexArray:
    return np.ascontiguousarray(np.atleast_1d(np.asarray(sources, dtype=np.int64)))


def _column(values: npt.ArrayLike) -> IndexArray:
    return np.ascontiguousarray(values, dtype=np.int64)
