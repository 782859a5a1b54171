"""Deviations at inspection points, and distances between two of them."""

from dataclasses import dataclass

import numpy as np

from pipeline.core.acceptance import DistanceLimits, PointLimits
from pipeline.core.errors import PointOffSurface
from pipeline.core.mesh import FloatArray, Mesh
from pipeline.inspection.measured_surface import MeasuredSurface
from pipeline.inspection.patches import Value, median_of
from pipeline.inspection.pose_error import PoseError
from pipeline.kernels.surface import Surface

#: Scan vertices at a point, at least, for a value. Chosen by hand: with fewer there is no scatter.
MIN_VERTICES = 3
#: Cosine of the largest angle between the normal at a point and that of what is measured there (60 degrees).
#: Chosen by hand.
MIN_COSINE = 0.5


@dataclass(frozen=True, slots=True)
class MeasuredPoint:
    """position_mm, normal : (3,) the place of the design's surface that was measured, and its unit normal;
    value : the deviation along the normal, None where the scan shows too little of it
    """

    position_mm: FloatArray
    normal: FloatArray
    value: Value | None


def measured_point(
    point: PointLimits, surface: MeasuredSurface, design: Surface, inflation: float = 1.0
) -> MeasuredPoint:
    """The median deviation of the scan vertices whose closest place of the design lies within the radius of
    the point, on surface that faces as it does there. inflation : as in `patches.median_of`

    Raises
    ------
    PointOffSurface
        When no surface of the design (with the normal asked for) is within the radius of the point.
    """
    position = np.array([point.position_mm], dtype=np.float64)
    on = design if point.normal is None else facing(design, np.array(point.normal))
    if on is None:
        raise PointOffSurface(
            "no surface of the design faces in the direction of the normal of inspection point "
            f"{point.name!r}",
            mesh="design",
        )
    closest = on.closest(position)
    if closest.distance[0] > point.radius_mm:
        asked = "" if point.normal is None else " with its normal"
        raise PointOffSurface(
            f"inspection point {point.name!r} is {closest.distance[0]:.3g} mm off the design's surface"
            f"{asked}, more than its radius_mm of {point.radius_mm:g}",
            mesh="design",
        )
    place, normal = closest.point[0], closest.normal[0]
    near = np.linalg.norm(surface.foot_mm - place, axis=1) <= point.radius_mm
    near &= surface.normal @ normal >= MIN_COSINE
    members = surface.signed_mm[near]
    value = median_of(members, inflation) if len(members) >= MIN_VERTICES else None
    return MeasuredPoint(place, normal, value)


def off_nominal(
    distance: DistanceLimits, measured: dict[str, MeasuredPoint], pose_error: PoseError | None = None
) -> tuple[float, float | None, int] | None:
    """By how much two measured points are farther apart than on the design, mm, its standard error, and the
    number of scan vertices; None where one of them was not measured. pose_error : of the alignment
    """
    first, second = measured[distance.first], measured[distance.second]
    if first.value is None or second.value is None:
        return None
    at_first = first.position_mm + first.value.median_mm * first.normal
    at_second = second.position_mm + second.value.median_mm * second.normal
    nominal_mm = float(np.linalg.norm(second.position_mm - first.position_mm))
    along = (second.position_mm - first.position_mm) / max(nominal_mm, 1e-300)
    value_mm = float(np.linalg.norm(at_second - at_first)) - nominal_mm
    n = first.value.n + second.value.n
    if first.value.error_mm is None or second.value.error_mm is None:
        return value_mm, None, n
    levers = np.array([-float(first.normal @ along), float(second.normal @ along)])
    of_points = levers * (first.value.error_mm, second.value.error_mm)
    of_pose = 0.0
    if pose_error is not None:  # one motion moves both ends
        places = np.stack([first.position_mm, second.position_mm])
        rows = pose_error.rows(places, np.stack([first.normal, second.normal]))
        of_pose = float(pose_error.of_rows((levers[:, None] * rows).sum(axis=0, keepdims=True))[0])
    return value_mm, float(np.sqrt((of_points**2).sum() + of_pose**2)), n


def facing(design: Surface, direction: FloatArray) -> Surface | None:
    """The surface whose normal is within `MIN_COSINE` of `direction` (3,); None where there is none."""
    wanted = direction / np.linalg.norm(direction)
    cross = design.mesh.face_cross_mm2()
    cosine = cross @ wanted / np.maximum(np.linalg.norm(cross, axis=1), 1e-300)
    chosen = np.flatnonzero(cosine >= MIN_COSINE)
    return Surface(Mesh(design.mesh.vertices, design.mesh.faces[chosen])) if len(chosen) else None
