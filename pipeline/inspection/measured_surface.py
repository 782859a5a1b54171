"""What the scan shows of the design's surface: signed deviations, each at its place on the design."""

from dataclasses import dataclass

import numpy as np

from pipeline.analysis.design_model import DesignModel
from pipeline.core.brep_faces import BrepFaces
from pipeline.core.mesh import BoolArray, FloatArray, IndexArray
from pipeline.stages.deviation import Deviations, side_of, signed_to_scan
from pipeline.stages.registration import Registration

#: Cosine of the angle between the normal of the design and the way to the scan (60 degrees), below which the
#: scan lies beside the place and not before it. Derived: at the corner of a box, where the normal is the mean
#: of three, a shift of one face has 0.58.
MIN_WAY_COSINE = 0.5
#: Distance over the diagonal up to which that is not asked: of rounding every direction is as likely. Chosen
#: by hand: 0.01 mm on a part of 100 mm.
NEAR_SHARE = 1e-4


@dataclass(frozen=True, slots=True, eq=False)
class MeasuredSurface:
    """The n scan vertices that count, each at the closest place of the design; and c places of the design,
    the vertices of its working mesh, with what lies nearest to them on the scan.

    foot_mm : (n, 3), on the design; normal : (n, 3) outward unit normals of the design there; face : (n,) its
    triangle; signed_mm : (n,) deviation, + outside; area : (n,) share of the scan's area

    place_mm, place_normal, place_area_mm2, place_face : of the c places; ends : (k, 2) neighbours among them;
    signed_at_place_mm : (c,) deviation by the nearest place of the scan, nan where the scan ends

    segment_of_face : (m,) segment of each triangle of the design; brep : faces of its CAD model;
    vertex_area_mm2 : area of the scan over its number of vertices
    """

    foot_mm: FloatArray
    normal: FloatArray
    face: IndexArray
    signed_mm: FloatArray
    area: FloatArray
    place_mm: FloatArray
    place_normal: FloatArray
    place_area_mm2: FloatArray
    place_face: IndexArray
    signed_at_place_mm: FloatArray
    segment_of_face: IndexArray
    brep: BrepFaces | None
    vertex_area_mm2: float

    def seen(self) -> float:
        """Share of the design's area that the scan shows, by the places: where it does not end."""
        shown = self.place_area_mm2[np.isfinite(self.signed_at_place_mm)]
        return min(1.0, float(shown.sum() / max(float(self.place_area_mm2.sum()), 1e-300)))

    @classmethod
    def of(cls, registration: Registration, deviations: Deviations, design: DesignModel) -> "MeasuredSurface":
        """Under the final pose."""
        fit, counted = registration.fit, deviations.counted
        working, scan = design.analysis.resampled.mesh, registration.scan
        on_design = design.surface.closest(working.vertices)
        # A cloud has no area of its own: that of the design, as far as the scan covers it
        covered_mm2 = registration.design_coverage * float(design.analysis.mesh.face_areas_mm2().sum())
        scan_area_mm2 = covered_mm2 if scan.is_cloud else float(scan.face_areas_mm2().sum())
        area = scan.weights()[counted]
        return cls(
            foot_mm=fit.closest.point[counted],
            normal=fit.closest.normal[counted],
            face=fit.closest.face[counted],
            signed_mm=deviations.signed_mm[counted],
            area=area / max(float(area.sum()), 1e-300),
            place_mm=on_design.point,
            place_normal=on_design.normal,
            place_area_mm2=working.vertex_areas_mm2(),
            place_face=on_design.face,
            signed_at_place_mm=_from_design(registration, design, working.vertices, on_design.normal),
            segment_of_face=np.asarray(design.analysis.segment_of_faces(), dtype=np.int64),
            brep=design.cached.brep,
            vertex_area_mm2=scan_area_mm2 / max(len(scan.vertices), 1),
        )


def _from_design(
    registration: Registration, design: DesignModel, places: FloatArray, normals: FloatArray
) -> FloatArray:
    """(c,) signed distance of places of the design to the scan's surface, + where the scan stands out; nan
    where the scan ends, and everywhere for a point cloud, which has no surface.

    It shows what no scan vertex lies near: a piece that broke off. What lies to the side of a place is no
    deviation of it: on a wall that was not scanned the way to the scan leads along the wall, to its upper
    edge.
    """
    surface, fit = registration.scan_surface, registration.fit
    if surface is None:
        return np.full(len(places), np.nan)
    signed, ends_there, way_mm = signed_to_scan(places, registration.scan, surface, fit)
    ends_there |= lies_beside(way_mm, normals, NEAR_SHARE * design.diagonal_mm)
    if side_of(design.analysis.mesh) == "none":
        signed = np.abs(signed)
    return np.where(ends_there, np.nan, signed)


def lies_beside(way_mm: FloatArray, normals: FloatArray, near_mm: float) -> BoolArray:
    """(k,) whether the scan lies beside a place of the design, and not before or behind it. way_mm : (k, 3)
    from the place to the closest of the scan; normals : (k, 3) unit normals of the design; near_mm : up to it
    the scan shows the place, whatever the direction
    """
    along, distance_mm = np.abs(np.einsum("kd,kd->k", way_mm, normals)), np.linalg.norm(way_mm, axis=1)
    return np.asarray((distance_mm > near_mm) & (along < MIN_WAY_COSINE * distance_mm))
