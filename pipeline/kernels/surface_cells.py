"""A surface in cells of one size: what a value is on average over each, whatever the density of the mesh.

A cell is what of the surface lies connected within one voxel: the two faces of a thin wall are two cells.
"""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_matrix, csgraph, csr_matrix

from pipeline.core.mesh import FloatArray, IndexArray

#: Voxels along one axis, at most: three axes fit in one 64-bit number.
MAX_VOXELS = 2**20


@dataclass(frozen=True, slots=True, eq=False)
class SurfaceCells:
    """of_vertex : (n,) the cell of each vertex; centre_mm : (c, 3) weighted mean of its vertices; weight :
    (c,) their sum, mm^2 where the weights are areas; adjacency : (c, c) 1 where an edge of the mesh joins
    two cells, and on the diagonal
    """

    of_vertex: IndexArray
    centre_mm: FloatArray
    weight: FloatArray
    adjacency: csr_matrix

    @classmethod
    def of(
        cls, vertices: FloatArray, ends: IndexArray, weights: FloatArray, voxel_mm: float
    ) -> "SurfaceCells":
        """The cells of a mesh. vertices : (n, 3) mm; ends : (k, 2) of its edges; weights : (n,) >= 0, of its
        vertices
        """
        voxel = np.floor((vertices - vertices.min(axis=0)) / voxel_mm)
        key = np.minimum(voxel, MAX_VOXELS - 1).astype(np.int64) @ np.array([MAX_VOXELS**2, MAX_VOXELS, 1])
        within = ends[key[ends[:, 0]] == key[ends[:, 1]]]
        n = len(vertices)
        graph = coo_matrix((np.ones(len(within), dtype=np.int8), (within[:, 0], within[:, 1])), shape=(n, n))
        count, of_vertex = csgraph.connected_components(graph, directed=False)
        weight = np.bincount(of_vertex, weights=weights, minlength=count).astype(np.float64)
        safe = np.maximum(weights, 1e-12 * max(float(weights.max(initial=0.0)), 1e-300))
        total = np.bincount(of_vertex, weights=safe, minlength=count)
        sums = [np.bincount(of_vertex, weights=safe * axis, minlength=count) for axis in vertices.T]
        across = of_vertex[ends]
        across = across[across[:, 0] != across[:, 1]]
        rows = np.concatenate([across[:, 0], across[:, 1], np.arange(count)])
        columns = np.concatenate([across[:, 1], across[:, 0], np.arange(count)])
        adjacency = coo_matrix((np.ones(len(rows)), (rows, columns)), shape=(count, count)).tocsr()
        adjacency.data[:] = 1.0  # many edges join the same two cells
        return cls(of_vertex.astype(np.int64), np.stack(sums, axis=1) / total[:, None], weight, adjacency)

    def means(self, values: FloatArray, weights: FloatArray) -> FloatArray:
        """(c,) weighted mean of `values` (n,) over each cell; 0 where a cell has no weight."""
        summed = np.bincount(self.of_vertex, weights=weights * values, minlength=len(self.weight))
        total = np.bincount(self.of_vertex, weights=weights, minlength=len(self.weight))
        return np.divide(summed, total, out=np.zeros(len(total)), where=total > 0)
