"""Measured surfaces by formula: deviations on a plate, so that every value is known."""

from collections.abc import Callable

import numpy as np

from pipeline.core.mesh import FloatArray, Mesh
from pipeline.inspection.measured_surface import MeasuredSurface
from tests.support import shapes


def plate(nx: int = 40, ny: int = 40) -> Mesh:
    """A flat plate of `nx` by `ny` mm in the plane z = 0, facing up, with a vertex every millimetre."""
    return shapes.grid_plane(nx, ny, 1.0)


def measured(
    deviation: Callable[[FloatArray], FloatArray], design: Mesh | None = None, *, step_mm: float = 0.25
) -> MeasuredSurface:
    """The plate scanned at points every `step_mm`, which deviate by `deviation(points)` mm."""
    design = design or plate()
    low, high = design.vertices.min(axis=0), design.vertices.max(axis=0)
    x, y = np.meshgrid(
        np.arange(low[0] + step_mm / 2, high[0], step_mm), np.arange(low[1] + step_mm / 2, high[1], step_mm)
    )
    foot = np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])
    n, c = len(foot), len(design.vertices)
    up = np.array([0.0, 0.0, 1.0])
    return MeasuredSurface(
        foot_mm=foot,
        normal=np.tile(up, (n, 1)),
        face=np.zeros(n, dtype=np.int64),
        signed_mm=deviation(foot),
        area=np.full(n, 1 / n),
        place_mm=design.vertices,
        place_normal=np.tile(up, (c, 1)),
        place_area_mm2=design.vertex_areas_mm2(),
        place_face=np.zeros(c, dtype=np.int64),
        signed_at_place_mm=np.full(c, np.nan),
        segment_of_face=np.zeros(len(design.faces), dtype=np.int64),
        brep=None,
        vertex_area_mm2=step_mm**2,
    )


def bump(points: FloatArray, centre: tuple[float, float], radius_mm: float, height_mm: float) -> FloatArray:
    """A flat-topped bump: `height_mm` within `radius_mm` of the centre, nothing elsewhere."""
    away = np.linalg.norm(points[:, :2] - np.array(centre), axis=1)
    return np.where(away <= radius_mm, height_mm, 0.0)
