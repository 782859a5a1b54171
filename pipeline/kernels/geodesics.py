"""Distances along the surface, behind one class.

This version follows mesh edges (Dijkstra): an upper bound of the true geodesic, on isotropic triangles some 5 to
10 % too long (`EXACT` is False and results carry the warning `geodesics_edge_path`). Everything that is asked of
distances, bounded searches, counts, the nearest denser vertex, quantiles, goes through `GeodesicSolver`, so
an exact kernel can take its place without a change elsewhere.
"""

from collections.abc import Iterator

import numpy as np
from scipy.sparse import coo_matrix, csgraph, csr_matrix

from pipeline.kernels import topology
from pipeline.mesh import FloatArray, IndexArray, IntArray

EXACT = False
_CHUNK_CELLS = 4_000_000  # distances held at once by a search from many sources: 32 MB
_SLACK = 1e-9  # a pair exactly at the radius may be found a rounding beyond it from one of its ends
_QUANTILE_SOURCES = 64


class GeodesicSolver:
    """Shortest paths on one mesh: built once, asked often.

    vertices : (n, 3) mm; faces : (m, 3). Distances are in mm, inf between connected pieces, and canonical:
    d(i, j) is the smaller of the two directions' sums, hence symmetric to the last bit.
    """

    def __init__(self, vertices: FloatArray, faces: IntArray) -> None:
        self.n = len(vertices)
        ends = topology.edges(faces).ends
        lengths = np.linalg.norm(vertices[ends[:, 0]] - vertices[ends[:, 1]], axis=1)
        graph = coo_matrix((lengths, (ends[:, 0], ends[:, 1])), shape=(self.n, self.n)).tocsr()
        self._graph: csr_matrix = (graph + graph.T).tocsr()
        self.components: IntArray = topology.vertex_components(faces, self.n)

    def distances(self, source: int) -> FloatArray:
        """(n,) from one vertex to every vertex."""
        return np.asarray(csgraph.dijkstra(self._graph, directed=False, indices=[int(source)])[0], dtype=np.float64)

    def distances_from_set(self, sources: IndexArray) -> FloatArray:
        """(n,) distance to the nearest of `sources`; inf everywhere when there are none."""
        if sources.size == 0:
            return np.full(self.n, np.inf)
        return np.asarray(
            csgraph.dijkstra(self._graph, directed=False, indices=sources, min_only=True), dtype=np.float64
        )

    def within(self, radius: float) -> csr_matrix:
        """(n, n) all pairs i != j with d(i, j) <= radius, as stored entries; symmetric, sorted indices."""
        rows, columns, values = [], [], []
        for sources, block in self._blocks(np.arange(self.n), radius * (1 + _SLACK)):
            i, j = np.nonzero(np.isfinite(block))
            rows.append(sources[i])
            columns.append(j)
            values.append(block[i, j])
        i, j, d = np.concatenate(rows), np.concatenate(columns), np.concatenate(values)
        off = i != j
        one_way = csr_matrix((d[off], (i[off], j[off])), shape=(self.n, self.n))
        pairs = csr_matrix(one_way.minimum(one_way.T))
        pairs.data[pairs.data > radius] = 0.0
        pairs.eliminate_zeros()
        pairs.sort_indices()
        return pairs

    def count_within(self, radius: float) -> IndexArray:
        """(n,) number of other vertices with d <= radius."""
        return np.diff(self.within(radius).indptr).astype(np.int64)

    def nearest_denser(self, rho: FloatArray) -> tuple[IndexArray, FloatArray]:
        """For every vertex the nearest vertex that is denser, and the distance (Rodriguez & Laio 2014, eq. 2).

        Denser is a larger `rho`, or the same with a smaller index, so every piece has exactly one vertex with
        nobody denser: index -1 and distance inf. Of equally near ones the smaller index is taken.
        """
        rank = density_rank(rho)
        index = np.full(self.n, -1, dtype=np.int64)
        distance = np.full(self.n, np.inf)
        wanted = np.arange(self.n)
        radius = 2.0 * float(np.median(self._graph.data)) if self._graph.nnz else 0.0
        diameter = self._diameter_bound()
        while wanted.size and radius > 0:
            for sources, block in self._blocks(wanted, radius):
                block = np.where(rank[None, :] < rank[sources][:, None], block, np.inf)
                nearest = block.argmin(axis=1)
                found = np.isfinite(block[np.arange(len(sources)), nearest])
                index[sources[found]] = nearest[found]
                distance[sources[found]] = block[found, nearest[found]]
            wanted = wanted[index[wanted] < 0]
            if radius > diameter:
                break  # the densest vertex of each piece
            radius *= 4.0
        return index, distance

    def quantile(self, q: float) -> float:
        """d_c: the max(1, round(q N))-th smallest of the N = n (n - 1) / 2 pairwise distances.

        Pairs on different pieces come last, as inf. No n x n array: an upper estimate from a few sources, then
        all pairs inside it.
        """
        n_pairs = self.n * (self.n - 1) // 2
        k = max(1, round(q * n_pairs))
        sizes = np.bincount(self.components)
        if k > int((sizes * (sizes - 1) // 2).sum()):
            return float("inf")
        sources = np.linspace(0, self.n - 1, min(self.n, _QUANTILE_SOURCES)).astype(np.int64)
        sample = np.concatenate([block.ravel() for _, block in self._blocks(sources, np.inf)])
        sample = np.sort(sample[(sample > 0) & np.isfinite(sample)])
        radius = float(sample[min(len(sample) - 1, int(1.2 * q * len(sample)))])
        while True:
            pairs = self.within(radius).data
            if len(pairs) // 2 >= k:
                # every pair is stored twice, so the k-th smallest pair is entry 2k - 1 of the sorted data
                return float(np.partition(pairs, 2 * k - 1)[2 * k - 1])
            radius *= 1.3

    def _blocks(self, sources: IndexArray, limit: float) -> Iterator[tuple[IndexArray, FloatArray]]:
        """Distances from `sources` in chunks: ((c,), (c, n)), inf beyond `limit`."""
        step = max(1, _CHUNK_CELLS // max(1, self.n))
        for start in range(0, len(sources), step):
            chunk = sources[start : start + step]
            yield chunk, np.asarray(csgraph.dijkstra(self._graph, directed=False, indices=chunk, limit=limit))

    def _diameter_bound(self) -> float:
        """Twice the largest distance from the first vertex of each piece bounds every distance in it."""
        firsts = np.unique(self.components, return_index=True)[1]
        return 2.0 * max(
            (float(block[np.isfinite(block)].max()) for _, block in self._blocks(firsts, np.inf)), default=0.0
        )


def density_rank(rho: FloatArray) -> IndexArray:
    """(n,) 0 for the densest; equal densities rank by index."""
    rank = np.zeros(len(rho), dtype=np.int64)
    rank[np.argsort(-rho, kind="stable")] = np.arange(len(rho))
    return rank
