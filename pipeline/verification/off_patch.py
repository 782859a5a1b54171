"""Where one surface lies off the other by more than is usual on it."""

import numpy as np

from pipeline.core.mesh import FloatArray, IndexArray
from pipeline.kernels.surface_cells import SurfaceCells
from pipeline.kernels.surface_patches import Patch, largest_patch, without_low_order
from pipeline.verification.thresholds import DIFFERENCE

#: Standard deviations in a median absolute deviation (of the normal distribution).
SIGMA_PER_MAD = 1.4826


def off_patch(
    vertices: FloatArray,
    ends: IndexArray,
    areas_mm2: FloatArray,
    distances_mm: FloatArray,
    visible_mm: float,
    min_area_mm2: float,
    inlier_mm: float,
) -> Patch | None:
    """The largest patch of a surface that stands out of what is usual on it, and is visible; or one of half
    the area that stands out twice as far: as much material. A filled hole shows no more than its two ends.

    vertices : (n, 3) mm, design frame; ends : (k, 2) of the edges; areas_mm2, distances_mm : (n,) of the
    vertices; what of the distances is of low order is no difference; visible_mm : below it nothing is one;
    min_area_mm2 : of a patch
    """
    cells = SurfaceCells.of(
        vertices, ends, areas_mm2, float(np.sqrt(min_area_mm2 / DIFFERENCE.cells_per_patch))
    )
    mean_mm = cells.means(distances_mm, areas_mm2)
    clipped = np.clip(mean_mm, -inlier_mm, inlier_mm)
    trend = clipped - without_low_order(cells.centre_mm, clipped, np.maximum(cells.weight, 1e-12))
    left_mm = mean_mm - trend
    spread_mm = SIGMA_PER_MAD * float(np.median(np.abs(left_mm - np.median(left_mm))))
    limit_mm = max(DIFFERENCE.min_spreads * spread_mm, visible_mm)
    for times in (1, DIFFERENCE.deep_ratio):
        beyond = np.abs(left_mm) > times * limit_mm
        patch = largest_patch(cells.centre_mm, cells.adjacency, cells.weight, left_mm, beyond)
        if patch is not None and patch.area_mm2 >= min_area_mm2 / times:
            return patch
    return None
