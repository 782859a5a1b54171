"""A coarse grid of nearest surface samples: evaluates thousands of poses in milliseconds."""

import numpy as np

from pipeline.core.mesh import FloatArray
from pipeline.kernels import rigid
from pipeline.kernels.icp import MIN_AGREEMENT
from pipeline.kernels.nearest import nearest

#: Cells along the longest side of the box: a cell is about 2 % of the part. Chosen by hand; not fitted.
CELLS = 48
#: Poses times points that are processed at once; limits memory, changes no result.
BLOCK_SIZE = 2_000_000


class NearestGrid:
    """The sample nearest to the centre of each cell of a box around the samples.

    points : (k, 3) mm, normals : (k, 3) unit, target frame; max_distance_mm : distance at which costs are
    truncated, also that from the samples to the sides of the box. A cell all of whose points are farther from
    every sample has no sample: finding one for it would take most of the time and change no cost.
    """

    def __init__(self, points: FloatArray, normals: FloatArray, max_distance_mm: float) -> None:
        low = points.min(axis=0) - max_distance_mm
        extent = np.ptp(points, axis=0) + 2 * max_distance_mm
        self._cell = float(extent.max()) / CELLS
        self._shape = np.maximum(1, np.ceil(extent / self._cell).astype(np.int64))
        self._low = low
        axes = [low[k] + self._cell * (np.arange(self._shape[k]) + 0.5) for k in range(3)]
        centres = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
        # A point of a cell is up to half a diagonal from its centre.
        reach_mm = max_distance_mm + np.sqrt(3.0) / 2 * self._cell
        self._nearest = nearest(points, centres, within_mm=1.001 * reach_mm)[1]
        self._max_distance_mm = max_distance_mm
        self._points, self._normals = points, normals

    def costs(
        self, T: FloatArray, normal_sign: FloatArray, points: FloatArray, normals: FloatArray
    ) -> FloatArray:
        """(h,) mm^2, mean squared distance of the points to the sample of their cell, truncated at
        max_distance_mm^2.

        A point outside the box, or with a normal more than 60 degrees from the sample's, costs
        max_distance_mm^2. T : (h, 4, 4) T_target_source; normal_sign : (h,) +1, or -1 to flip the normals of
        the points under that pose; points : (k, 3) mm, normals : (k, 3) unit, source frame
        """
        costs = np.zeros(len(T))
        max_distance_mm = self._max_distance_mm
        block = max(1, BLOCK_SIZE // max(1, len(points)))
        for start in range(0, len(T), block):
            chunk = T[start : start + block]
            moved = rigid.transformed(chunk, points)
            cell = np.floor((moved - self._low) / self._cell).astype(np.int64)
            inside = ((cell >= 0) & (cell < self._shape)).all(axis=2)
            cell = np.clip(cell, 0, self._shape - 1)
            sample = self._nearest[
                (cell[..., 0] * self._shape[1] + cell[..., 1]) * self._shape[2] + cell[..., 2]
            ]
            inside &= sample < len(self._points)
            sample = np.where(inside, sample, 0)
            squared = ((moved - self._points[sample]) ** 2).sum(axis=2)
            rotated = (
                rigid.rotated(chunk[:, :3, :3], normals) * normal_sign[start : start + block, None, None]
            )
            inside &= (rotated * self._normals[sample]).sum(axis=2) > MIN_AGREEMENT
            costs[start : start + block] = np.where(
                inside, np.minimum(squared, max_distance_mm**2), max_distance_mm**2
            ).mean(axis=1)
        return costs
