"""Which places of the design belong to a region."""

import numpy as np

from pipeline.core.acceptance import (
    BoxRegion,
    BrepFacesRegion,
    CylinderRegion,
    FacesRegion,
    NamedRegion,
    Region,
    SegmentsAtRegion,
    SegmentsRegion,
    SphereRegion,
)
from pipeline.core.brep_faces import BrepFaces
from pipeline.core.errors import PointOffSurface, UnknownRegion
from pipeline.core.mesh import BoolArray, FloatArray, IndexArray
from pipeline.kernels.surface import Surface

#: Names of faces that an error lists, at most.
MAX_LISTED = 20


def members(
    region: Region,
    name: str,
    points: FloatArray,
    face: IndexArray,
    segment_of_face: IndexArray,
    design: Surface,
    brep: BrepFaces | None = None,
) -> BoolArray:
    """(k,) whether each of `points` (k, 3) mm, on triangle `face` (k,) of the design, lies in the region.

    segment_of_face : (m,) segment of each triangle of the design; brep : faces of its CAD model, None where
    its file has none

    Raises
    ------
    UnknownRegion
        When it names a segment, a triangle or a face that the design does not have.
    PointOffSurface
        When a place of `segments_at` is not on the design.
    """
    match region:
        case BoxRegion():
            inside = (points >= np.array(region.min_mm)) & (points <= np.array(region.max_mm))
            return np.asarray(inside.all(axis=1))
        case SphereRegion():
            away = np.linalg.norm(points - np.array(region.centre_mm), axis=1)
            return np.asarray(away <= region.radius_mm)
        case CylinderRegion():
            start, axis = np.array(region.start_mm), np.array(region.end_mm) - np.array(region.start_mm)
            length = float(np.linalg.norm(axis))
            along = (points - start) @ (axis / length)
            away = np.linalg.norm(points - start - along[:, None] * (axis / length), axis=1)
            return np.asarray((along >= 0) & (along <= length) & (away <= region.radius_mm))
        case SegmentsRegion():
            _known(region.segments, int(segment_of_face.max()) + 1, name, "segment")
            return np.isin(segment_of_face[face], region.segments)
        case SegmentsAtRegion():
            closest = design.closest(np.array(region.places_mm, dtype=np.float64))
            far = int(closest.distance.argmax())
            if closest.distance[far] > region.radius_mm:
                raise PointOffSurface(
                    f"place {far} of region {name!r} is {closest.distance[far]:.3g} mm off the design's "
                    f"surface, more than its radius_mm of {region.radius_mm:g}",
                    mesh="design",
                )
            return np.isin(segment_of_face[face], segment_of_face[closest.face])
        case NamedRegion():
            raise UnknownRegion(
                f"region {name!r} refers to {region.name!r} of the characteristics of a design, which only "
                "the service keeps",
                mesh="design",
            )
        case FacesRegion():
            _known(region.faces, len(segment_of_face), name, "triangle")
            return np.isin(face, region.faces)
        case BrepFacesRegion():
            return np.isin(_brep(brep, name).of_triangle[face], _numbers(region, name, _brep(brep, name)))


def _brep(brep: BrepFaces | None, name: str) -> BrepFaces:
    if brep is None:
        raise UnknownRegion(
            f"region {name!r} names faces of a CAD model, but the file of the design has only triangles; "
            "send the design as STEP, or give another kind of region",
            mesh="design",
        )
    return brep


def _numbers(region: BrepFacesRegion, name: str, brep: BrepFaces) -> list[int]:
    """The numbers of the faces of a region; a name stands for every face that has it."""
    by_name: dict[str, list[int]] = {}
    for number, face in enumerate(brep.faces):
        by_name.setdefault(face.name, []).append(number)
    numbers: list[int] = []
    for each in region.faces:
        if isinstance(each, int):
            _known([each], len(brep.faces), name, "face")
            numbers.append(each)
        elif each in by_name:
            numbers += by_name[each]
        else:
            known = sorted(repr(each) for each in by_name if each)
            listed = ", ".join(known[:MAX_LISTED]) or "none of them has a name"
            raise UnknownRegion(
                f"region {name!r} names face {each!r}, but none of the {len(brep.faces)} faces of the design "
                f"has that name ({listed}{', ...' if len(known) > MAX_LISTED else ''}); all are listed in "
                "design.brep_faces.csv",
                mesh="design",
            )
    return numbers


def _known(numbers: list[int], count: int, name: str, what: str) -> None:
    if unknown := [number for number in numbers if number >= count]:
        raise UnknownRegion(
            f"region {name!r} names {what} {unknown[0]}, but the design has {count} (0 to {count - 1})",
            mesh="design",
        )
