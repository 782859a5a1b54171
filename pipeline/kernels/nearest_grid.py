"""A coarse grid of nearest surface samples: evaluates thousands of poses in milliseconds."""

import os

import numpy as np

from pipeline.core.mesh import FloatArray
from pipeline.kernels.icp import MIN_AGREEMENT
from pipeline.kernels.native import core

#: Cells along the longest side of the box: a cell is about 2 % of the part. Chosen by hand; not fitted.
CELLS = 48


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
        self._low = np.ascontiguousarray(low)
        self._points, self._normals = np.ascontiguousarray(points), np.ascontiguousarray(normals)
        # A point of a cell is up to half a diagonal from its centre.
        reach_mm = max_distance_mm + np.sqrt(3.0) / 2 * self._cell
        self._threads = len(os.sched_getaffinity(0))
        self._nearest = core.nearest_of_cells(
            self._points, self._low, self._cell, self._shape, 1.001 * reach_mm, self._threads
        )
        self._max_distance_mm = max_distance_mm

    def costs(
        self, T: FloatArray, normal_sign: FloatArray, points: FloatArray, normals: FloatArray
    ) -> FloatArray:
        """(h,) mm^2, mean squared distance of the points to the sample of their cell, truncated at
        max_distance_mm^2.

        A point outside the box, or with a normal more than 60 degrees from the sample's, costs
        max_distance_mm^2. T : (h, 4, 4) T_target_source; normal_sign : (h,) +1, or -1 to flip the normals of
        the points under that pose; points : (k, 3) mm, normals : (k, 3) unit, source frame
        """
        costs = core.grid_costs(
            self._nearest,
            self._points,
            self._normals,
            self._low,
            self._cell,
            self._shape,
            np.ascontiguousarray(T),
            np.ascontiguousarray(normal_sign),
            np.ascontiguousarray(points),
            np.ascontiguousarray(normals),
            max_distance=self._max_distance_mm,
            min_agreement=MIN_AGREEMENT,
            threads=self._threads,
        )
        return np.asarray(costs)
