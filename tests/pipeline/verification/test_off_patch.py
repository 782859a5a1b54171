"""How large and how deep a patch must be to stand out: on a flat plate, in closed form."""

import numpy as np
import pytest

from pipeline.core.mesh import FloatArray
from pipeline.kernels import topology
from pipeline.kernels.surface_patches import Patch
from pipeline.verification.off_patch import off_patch
from tests.support import shapes

VISIBLE_MM, MIN_AREA_MM2, INLIER_MM = 0.3, 40.0, 5.0
PLATE = shapes.grid_plane(101, 101, step_mm=1.0)


def found(depth_mm: float, area_mm2: float) -> Patch | None:
    """Of a round patch in the middle of the plate, so deep; the rest lies on the other surface."""
    centre = PLATE.vertices.mean(axis=0)
    inside = np.linalg.norm(PLATE.vertices - centre, axis=1) <= np.sqrt(area_mm2 / np.pi)
    distances_mm: FloatArray = np.where(inside, depth_mm, 0.0)
    ends = topology.edges(PLATE.faces).ends
    areas_mm2 = PLATE.vertex_areas_mm2()
    return off_patch(PLATE.vertices, ends, areas_mm2, distances_mm, VISIBLE_MM, MIN_AREA_MM2, INLIER_MM)


@pytest.mark.parametrize(
    ("depth_mm", "area_mm2", "is_found"),
    [
        (0.5, 100.0, True),  # large, less than twice as deep as visible
        (0.5, 30.0, False),  # too small for that depth
        (1.2, 45.0, True),  # of a patch so deep half the area is enough,
        (1.2, 12.0, False),  # and a quarter is not
        (0.2, 500.0, False),  # not visible
    ],
)
def test_a_patch_twice_as_deep_may_be_half_as_large(depth_mm: float, area_mm2: float, is_found: bool) -> None:
    for side in (1.0, -1.0):
        patch = found(side * depth_mm, area_mm2)
        assert (patch is not None) == is_found
        if patch is not None:
            assert np.sign(patch.mean) == side
