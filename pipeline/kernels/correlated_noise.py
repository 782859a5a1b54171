"""The noise of a scan on its design, told from its shape, and how far it is correlated between neighbours.

Shape varies slowly over a surface, noise does not: what a linear trend over blocks of 4 x 4 cells leaves is
noise. How much more the mean of a cell scatters than that of as many independent values says how correlated
it is within a cell. Noise that is correlated over more than a block looks like shape, and is not seen.
"""

from dataclasses import dataclass

import numpy as np

from pipeline.core.mesh import FloatArray, IndexArray

#: Edge of a block over that of a cell. Chosen by hand: the trend takes 3 of the 16 cells of a flat block.
BLOCK_CELLS = 4
#: Cells of a block, at least, for a slope beside its mean. Chosen by hand: two for each of three unknowns.
MIN_CELLS_FOR_SLOPE = 6
#: Values of a cell, at least, for its share in `inflation`, and such cells. Chosen by hand.
MIN_CELL_VALUES, MIN_CELLS = 6, 20
#: Median of the square of a normal variable with variance 1 (derived).
MEDIAN_CHI_SQUARE = 0.454936


@dataclass(frozen=True, slots=True, eq=False)
class Noise:
    """values : (k,) without the trend, mm; trend : (k,) mm; cell : (k,) number of the cell of each place;
    lost : factor that makes up for the variance of cell means that the trend takes, >= 1
    """

    values: FloatArray
    trend: FloatArray
    cell: IndexArray
    lost: float

    def inflation(self) -> float:
        """Variance of the mean of a cell over that of as many independent values, >= 1: a median over cells,
        so that places of another shape decide nothing. 1 where too few cells can tell.
        """
        n = np.bincount(self.cell)
        total = np.bincount(self.cell, weights=self.values)
        squares = np.bincount(self.cell, weights=self.values**2)
        told = (n >= MIN_CELL_VALUES) & (squares > 0)
        if told.sum() < MIN_CELLS:
            return 1.0
        # Two medians: the ratio cell by cell is biased where few values of a cell are independent
        of_sums = float(np.median(total[told] ** 2 / n[told])) / MEDIAN_CHI_SQUARE
        found = max(1.0, self.lost * of_sums / float(np.median(squares[told] / n[told])))
        # The median of a mean of k squares lies below it (Wilson & Hilferty 1931)
        k = max(1.0, float(np.median(n[told])) / found)
        return max(1.0, found * (1 - 2 / (9 * k)) ** 3)


def noise_of(points: FloatArray, normals: FloatArray, values: FloatArray, edge_mm: float) -> Noise:
    """Noise of `values` (k,) mm at places of a surface; k > 0.

    points : (k, 3) mm; normals : (k, 3) unit, of the surface; edge_mm : of the cubes that the surface is cut
    into, each cut once more by the axis that its normals are nearest to
    """
    edge_mm = max(edge_mm, 1e-5 * float(np.ptp(points, axis=0).max()), 1e-300)
    at = np.floor((points - points.min(axis=0)) / edge_mm).astype(np.int64)
    axis = np.abs(normals).argmax(axis=1)
    facing = 2 * axis + (normals[np.arange(len(axis)), axis] < 0)
    cell = _numbers(at, facing)
    block = _numbers(at // BLOCK_CELLS, facing)
    block_of_cell = np.zeros(int(cell.max()) + 1, dtype=np.int64)
    block_of_cell[cell] = block
    cells = np.bincount(block_of_cell)
    trend, unknowns = _trend(points, axis, values, block, cells)
    lost = len(block_of_cell) / max(len(block_of_cell) - unknowns, 1)
    return Noise(values - trend, trend, cell, lost)


def _numbers(at: FloatArray | IndexArray, facing: IndexArray) -> IndexArray:
    """(k,) one number for each distinct cube and side."""
    keys = np.ravel_multi_index((*at.T, facing), (*(at.max(axis=0) + 1), 6))
    return np.asarray(np.unique(keys, return_inverse=True)[1], dtype=np.int64)


def _trend(
    points: FloatArray, axis: IndexArray, values: FloatArray, block: IndexArray, cells: IndexArray
) -> tuple[FloatArray, int]:
    """(k,) mean, or plane, of each block over the two coordinates across its axis, and how many unknowns all
    of these have. cells : (b,) of each block; a block of one cell has no trend
    """
    n = np.bincount(block).astype(np.float64)

    def mean_of(each: FloatArray) -> FloatArray:
        return np.asarray(np.bincount(block, weights=each) / n)

    across = np.stack([points[np.arange(len(axis)), (axis + turn) % 3] for turn in (1, 2)])
    across = across - np.stack([mean_of(each)[block] for each in across])
    mean = mean_of(values)
    centred = values - mean[block]
    uu, uv, vv = (mean_of(across[i] * across[j]) for i, j in ((0, 0), (0, 1), (1, 1)))
    uy, vy = (mean_of(each * centred) for each in across)
    determinant = uu * vv - uv**2
    sloped = (cells >= MIN_CELLS_FOR_SLOPE) & (determinant > 1e-3 * np.maximum(uu, vv) ** 2)
    determinant = np.where(sloped, determinant, 1.0)
    slope_u = np.where(sloped, (vv * uy - uv * vy) / determinant, 0.0)
    slope_v = np.where(sloped, (uu * vy - uv * uy) / determinant, 0.0)
    several = cells > 1
    trend = np.where(several, mean, 0.0)[block] + slope_u[block] * across[0] + slope_v[block] * across[1]
    return trend, int(several.sum() + 2 * sloped.sum())
