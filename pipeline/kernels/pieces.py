"""Connected pieces of a mesh, and of a point cloud: what hangs together, how large it is, what lies apart."""

import itertools
from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_matrix, csgraph
from scipy.spatial import cKDTree

from pipeline.core.mesh import BoolArray, FloatArray, IntArray, Mesh
from pipeline.kernels import topology
from pipeline.kernels.rows import group_rows

#: Points of a cloud hang together when their cells, so many times the median spacing wide, touch. Chosen by
#: hand: a scanner leaves gaps of two or three spacings; a table lies further below a part.
CELL_SPACINGS = 4.0
#: About so many points, at least, whose nearest neighbours give the spacing of a cloud. Chosen by hand.
SPACING_SAMPLES = 2000
#: Largest distance of the centres of two touching cells, in cells: their corners meet (derived, rounded up).
TOUCHING_CELLS = 1.75
#: (13, 3) unit: the axes, and the diagonals of the faces and the body of a cube.
DIRECTIONS = np.array(
    [each for each in itertools.product((-1.0, 0.0, 1.0), repeat=3) if each > (0.0, 0.0, 0.0)]
)
DIRECTIONS /= np.linalg.norm(DIRECTIONS, axis=1, keepdims=True)


@dataclass(frozen=True, slots=True)
class Pieces:
    """The pieces of one mesh, numbered by their first vertex.

    of_vertex : (n,) piece of each vertex; weight : (p,) area in mm^2, of a cloud the number of points;
    low, high : (p, 3) mm, corners of its axis-aligned box
    """

    of_vertex: IntArray
    weight: FloatArray
    low: FloatArray
    high: FloatArray

    @classmethod
    def of(cls, mesh: Mesh) -> "Pieces":
        """The pieces of a mesh, or of a point cloud."""
        return cls.numbered(mesh, _clusters(mesh.vertices) if mesh.is_cloud else _components(mesh))

    @classmethod
    def numbered(cls, mesh: Mesh, of_vertex: IntArray) -> "Pieces":
        """The pieces of a mesh whose vertices have these numbers (n,), from 0 without a gap."""
        count = int(of_vertex.max(initial=-1)) + 1
        weights = np.ones(len(of_vertex)) if mesh.is_cloud else mesh.vertex_areas_mm2()
        low, high = np.full((count, 3), np.inf), np.full((count, 3), -np.inf)
        np.minimum.at(low, of_vertex, mesh.vertices)
        np.maximum.at(high, of_vertex, mesh.vertices)
        weight = np.bincount(of_vertex, weights=weights, minlength=count).astype(np.float64)
        return cls(of_vertex, weight, low, high)

    @property
    def count(self) -> int:
        """How many there are."""
        return len(self.weight)

    def diagonals_mm(self) -> FloatArray:
        """(p,) diagonal of the box of each."""
        return np.asarray(np.linalg.norm(self.high - self.low, axis=1))

    def diameters_mm(self, mesh: Mesh) -> FloatArray:
        """(p,) about the largest distance of two vertices of each piece of `mesh`, nearly the same in any
        pose: at most the diameter, and at least 0.89 of it.

        The widest of `DIRECTIONS`, none farther than 27 degrees from any; then from the vertex at one end of
        that width to the vertex farthest from it, which for most parts is the diameter.
        """
        order = np.argsort(self.of_vertex, kind="stable")
        vertices, piece = mesh.vertices[order], self.of_vertex[order]
        first = np.searchsorted(piece, np.arange(self.count))
        along = [vertices @ direction for direction in DIRECTIONS]
        width = np.stack([np.maximum.reduceat(x, first) - np.minimum.reduceat(x, first) for x in along])
        value = np.choose(width.argmax(axis=0)[piece], along)
        diameter = width.max(axis=0)
        for _ in range(2):  # from the end of the width to the farthest vertex, and on from there
            start = np.flatnonzero(value == np.maximum.reduceat(value, first)[piece])
            start = start[np.searchsorted(piece[start], np.arange(self.count))]
            value = np.linalg.norm(vertices - vertices[start][piece], axis=1)
            diameter = np.maximum(diameter, np.maximum.reduceat(value, first))
        return np.asarray(diameter, dtype=np.float64)

    def diagonal_mm(self, chosen: BoolArray) -> float:
        """Diagonal of the common box of the `chosen` (p,) ones."""
        low, high = self.low[chosen].min(axis=0), self.high[chosen].max(axis=0)
        return float(np.linalg.norm(high - low))

    def box_gaps_mm(self, chosen: BoolArray) -> FloatArray:
        """(p,) distance of the box of each from the common box of the `chosen` (p,) ones; 0 where they
        meet.
        """
        low, high = self.low[chosen].min(axis=0), self.high[chosen].max(axis=0)
        apart = np.maximum(np.maximum(low - self.high, self.low - high), 0.0)
        return np.asarray(np.linalg.norm(apart, axis=1))

    def largest(self, share: float) -> BoolArray:
        """(p,) the fewest pieces, largest first, that hold this share of the weight."""
        order = np.argsort(-self.weight, kind="stable")
        before = np.cumsum(self.weight[order]) - self.weight[order]
        chosen = np.zeros(self.count, dtype=np.bool_)
        chosen[order[before < share * self.weight.sum()]] = True
        return chosen


def _components(mesh: Mesh) -> IntArray:
    return topology.vertex_components(mesh.faces, len(mesh.vertices))


def _clusters(points: FloatArray) -> IntArray:
    """(n,) int32: points whose cells touch, directly or through others, numbered by their first point."""
    some = points[:: max(1, len(points) // SPACING_SAMPLES)]
    distance, _ = cKDTree(points).query(some, k=[2])
    cell_mm = CELL_SPACINGS * max(float(np.median(distance)), 1e-300)
    cells = np.floor((points - points.min(axis=0)) / cell_mm)
    first, cell_of_point = group_rows(cells)
    pairs = cKDTree(cells[first]).query_pairs(TOUCHING_CELLS, output_type="ndarray")
    graph = coo_matrix((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(len(first), len(first)))
    return np.asarray(csgraph.connected_components(graph, directed=False)[1][cell_of_point], dtype=np.int32)
