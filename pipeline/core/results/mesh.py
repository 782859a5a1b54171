"""Segments and landmarks of one mesh."""

from typing import Literal

from pydantic import Field

from pipeline.core.results.base import Record, Vector3
from pipeline.core.settings import SegmentationMethod


class Landmark(Record):
    id: int = Field(description="numbered from 0, strongest first")
    vertex: int = Field(description="vertex of <mesh>.clean.ply nearest to position_mm")
    position_mm: Vector3 = Field(description="in the mesh's own frame, in mm")
    normal: Vector3 = Field(description="unit outward normal there")
    segment: int = Field(description="number of its segment")
    t2: float = Field(
        description="T^2 relative to the spread of its segment (at most that of the part); the T^2 limit "
        "applies to it"
    )
    strength: float = Field(
        description="sort key: T^2 relative to the spread of the whole part, over its limit, so that "
        "segments "
        "are comparable (statistics `segment`: spread and limit of the segment)"
    )


class Match(Record):
    design: int = Field(description="`id` of the landmark of the design")
    scan: int = Field(description="`id` of the landmark of the scan")
    residual_mm: float = Field(description="distance of the two landmarks under the final transform")


class Landmarks(Record):
    design: list[Landmark] = Field(description="of the design, the strongest first")
    scan: list[Landmark] = Field(description="of the scan, the strongest first")
    matches: list[Match] = Field(description="corresponding landmarks; empty without a pose")


class Centre(Record):
    segment: int = Field(description="number of the segment, from 0")
    vertex: int = Field(description="its density peak, a vertex of <mesh>.clean.ply")
    position_mm: Vector3 = Field(description="of the peak, in the frame of the mesh")
    rho: float = Field(description="density at the peak (Rodriguez & Laio)")
    delta: float = Field(description="geodesic distance in mm to the nearest point of higher density")
    size: int = Field(description="vertices of the cleaned mesh in the segment")
    brep_faces: list[int] | None = Field(
        None,
        description="faces of the CAD model with most of their area in the segment, as in "
        "`<mesh>.brep_faces.csv`; null: the file has only triangles",
    )


class Segments(Record):
    count: int = Field(description="number of segments")
    method: SegmentationMethod = Field(description="the clustering")
    metric: Literal["surface", "crease"] = Field(
        description="surface: geodesic distance; crease: longer across valleys"
    )
    density: Literal["vertex", "area", "convexity"] = Field(
        description="what rho counts: vertices, area, or area by convexity"
    )
    d_c: float = Field(description="cut-off distance in mm")
    halo_fraction: float = Field(description="share of the working vertices that are halo")
    limit_share: float | None = Field(
        description="share of the working vertices beyond the T^2 limit; null: no landmarks were computed"
    )
    centres: list[Centre] = Field(description="the density peaks, by segment")


class SegmentsPair(Record):
    design: Segments = Field(description="of the design")
    scan: Segments | None = Field(description="null: the scan has no surface that can be segmented")


class SegmentsOfMesh(Record):
    mesh: Segments = Field(description="of the mesh")


class LandmarksOfMesh(Record):
    mesh: list[Landmark] = Field(description="of the mesh, the strongest first")
