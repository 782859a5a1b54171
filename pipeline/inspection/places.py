"""Whether the design has every place that the limits and the alignment of a job name, before the search."""

import numpy as np

from pipeline.analysis.design_model import DesignModel
from pipeline.core.acceptance import Acceptance, Region
from pipeline.core.alignment import Alignment, BestFit, ConstrainedFit, RpsFit
from pipeline.core.errors import PointOffSurface
from pipeline.core.mesh import FloatArray
from pipeline.inspection import regions


def check_places(design: DesignModel, acceptance: Acceptance | None, alignment: Alignment | None) -> None:
    """The search takes seconds and may end without a pose, which needs no region: a wrong name is told first.

    A point is only compared with the nearest surface, whatever way that faces.

    Raises
    ------
    UnknownRegion
        When a region names a segment, a triangle or a face that the design does not have.
    PointOffSurface
        When a place or a point is farther off the surface than its radius.
    """
    named: list[tuple[str, Region]] = []
    points: list[tuple[str, list[float], float]] = []
    if acceptance is not None:
        named += [(each.name, each.region) for each in acceptance.regions]
        points += [
            (f"inspection point {each.name!r}", each.position_mm, each.radius_mm)
            for each in acceptance.points
        ]
    if isinstance(alignment, BestFit | ConstrainedFit):
        named += [
            (f"alignment.regions[{number}]", each.region) for number, each in enumerate(alignment.regions)
        ]
    if isinstance(alignment, RpsFit):
        points += [
            (f"alignment point {each.name!r}", each.position_mm, each.radius_mm) for each in alignment.points
        ]
    _check_regions(named, design)
    _check_points(points, design)


def _check_regions(named: list[tuple[str, Region]], design: DesignModel) -> None:
    if not named:
        return
    segment_of_face = np.asarray(design.analysis.segment_of_faces(), dtype=np.int64)
    nowhere: FloatArray = np.empty((0, 3))
    for name, region in named:
        on_design = (segment_of_face, design.surface, design.cached.brep)
        regions.members(region, name, nowhere, np.empty(0, dtype=np.int64), *on_design)


def _check_points(points: list[tuple[str, list[float], float]], design: DesignModel) -> None:
    if not points:
        return
    away_mm = design.surface.closest(np.array([position for _, position, _ in points])).distance
    for (what, _, radius_mm), distance_mm in zip(points, away_mm, strict=True):
        if distance_mm > radius_mm:
            raise PointOffSurface(
                f"{what} is {distance_mm:.3g} mm off the design's surface, more than its radius_mm of "
                f"{radius_mm:g}",
                mesh="design",
            )
