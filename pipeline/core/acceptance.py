"""What a part must satisfy to pass: limits of its deviation, of regions of it, and of single points.

Deviations are signed distances to the design in mm, + outside. Places are in the design's frame, in mm.
"""

from typing import Annotated, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, model_validator

#: Why a share alone is no limit.
WITHIN_WHAT = "min_within needs tolerance_mm, or lower_mm or upper_mm"
Length = Annotated[float, Field(gt=0, le=1e6, description="mm")]
Share = Annotated[float, Field(gt=0, le=1)]
Place = Annotated[list[float], Field(min_length=3, max_length=3)]
Name = Annotated[str, Field(min_length=1, max_length=100, pattern=r"^[^\x00-\x1f]+$")]
#: Regions, points and distances of one job, at most: limits time and the size of the results.
MAX_REGIONS, MAX_POINTS = 200, 1000


class OptionPart(BaseModel):
    """Base of what a job states about its part: an unknown key is an error."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class Limits(OptionPart):
    """Lower and upper limit of a deviation; `tolerance_mm` is short for both."""

    tolerance_mm: Length | None = Field(None, description="limits of - and + this; instead of the next two")
    lower_mm: float | None = Field(None, description="the deviation must be at least this")
    upper_mm: float | None = Field(None, description="the deviation must be at most this")

    @model_validator(mode="after")
    def _agree(self) -> Self:
        if self.tolerance_mm is not None and (self.lower_mm is not None or self.upper_mm is not None):
            raise ValueError("tolerance_mm stands for lower_mm and upper_mm: give it or them, not both")
        if self.lower_mm is not None and self.upper_mm is not None and self.lower_mm >= self.upper_mm:
            raise ValueError(f"lower_mm ({self.lower_mm:g}) must be below upper_mm ({self.upper_mm:g})")
        return self

    @property
    def lower(self) -> float | None:
        return self.lower_mm if self.tolerance_mm is None else -self.tolerance_mm

    @property
    def upper(self) -> float | None:
        return self.upper_mm if self.tolerance_mm is None else self.tolerance_mm

    @property
    def are_given(self) -> bool:
        return self.lower is not None or self.upper is not None


class SurfaceLimits(Limits):
    """What the surface must satisfy, over a whole part or a region of it."""

    min_within: Share | None = Field(
        None,
        description="share of the area between the limits, at least. Without it every patch of the surface "
        "must lie between them",
    )
    max_deviation_mm: Length | None = Field(
        None, description="no patch of the surface may deviate by more, to either side"
    )


class BoxRegion(OptionPart):
    """Between two corners, along the axes of the design."""

    kind: Literal["box"] = Field(description="kind of the region")
    min_mm: Place = Field(description="lowest x, y, z")
    max_mm: Place = Field(description="highest x, y, z")

    @model_validator(mode="after")
    def _has_volume(self) -> Self:
        if any(low >= high for low, high in zip(self.min_mm, self.max_mm, strict=True)):
            raise ValueError("each value of min_mm must be below that of max_mm")
        return self


class SphereRegion(OptionPart):
    """Within a distance of a point."""

    kind: Literal["sphere"] = Field(description="kind of the region")
    centre_mm: Place = Field(description="its centre")
    radius_mm: Length = Field(description="its radius")


class CylinderRegion(OptionPart):
    """Within a distance of a line, between its two ends."""

    kind: Literal["cylinder"] = Field(description="kind of the region")
    start_mm: Place = Field(description="one end of its axis")
    end_mm: Place = Field(description="the other end")
    radius_mm: Length = Field(description="its radius")

    @model_validator(mode="after")
    def _has_length(self) -> Self:
        if self.start_mm == self.end_mm:
            raise ValueError("start_mm and end_mm must differ")
        return self


class SegmentsRegion(OptionPart):
    """Segments of the design, by number. The same design and settings have the same segments every time."""

    kind: Literal["segments"] = Field(description="kind of the region")
    segments: list[Annotated[int, Field(ge=0)]] = Field(min_length=1, description="as in `segments.design`")


class FacesRegion(OptionPart):
    """Triangles of the design, by number."""

    kind: Literal["faces"] = Field(description="kind of the region")
    faces: list[Annotated[int, Field(ge=0)]] = Field(
        min_length=1, max_length=1_000_000, description="numbers of triangles, from 0, in `design.clean.ply`"
    )


class BrepFacesRegion(OptionPart):
    """Faces of the CAD model (planes, cylinders, ...), of a design in STEP."""

    kind: Literal["brep_faces"] = Field(description="kind of the region")
    faces: list[Annotated[int, Field(ge=0)] | Name] = Field(
        min_length=1,
        max_length=10_000,
        description="number of each, as in `design.brep_faces.csv`, or the name that it has in the file",
    )


class SegmentsAtRegion(OptionPart):
    """The segments of the design at these places: the same ones, whatever their numbers are."""

    kind: Literal["segments_at"] = Field(description="kind of the region")
    places_mm: list[Place] = Field(
        min_length=1, max_length=MAX_REGIONS, description="on the design's surface, one in each segment"
    )
    radius_mm: Length = Field(1.0, description="how far a place may be from the surface")


class NamedRegion(OptionPart):
    """A region of the design's characteristics (`PUT /v1/designs/{blob}/characteristics`)."""

    kind: Literal["named"] = Field(description="kind of the region")
    name: Name = Field(description="of the region, as the characteristics have it")


SurfaceRegion = Annotated[
    BoxRegion
    | SphereRegion
    | CylinderRegion
    | SegmentsRegion
    | SegmentsAtRegion
    | FacesRegion
    | BrepFacesRegion,
    Field(discriminator="kind"),
]
Region = Annotated[
    BoxRegion
    | SphereRegion
    | CylinderRegion
    | SegmentsRegion
    | SegmentsAtRegion
    | FacesRegion
    | BrepFacesRegion
    | NamedRegion,
    Field(discriminator="kind"),
]


class RegionLimits(SurfaceLimits):
    """Limits of one region; they replace those of the part there."""

    name: Name = Field(description="of the region, in the results")
    region: Region = Field(description="which part of the design's surface")

    @model_validator(mode="after")
    def _has_limits(self) -> Self:
        if not self.are_given and self.max_deviation_mm is None:
            raise ValueError(f"region {self.name!r} has no limits; give tolerance_mm or another limit")
        if self.min_within is not None and not self.are_given:
            raise ValueError(f"region {self.name!r}: {WITHIN_WHAT}")
        return self


class PointLimits(Limits):
    """Limits of the deviation at a point of the surface, taken along the normal there."""

    name: Name = Field(description="of the point, in the results")
    position_mm: Place = Field(description="on the design's surface; the nearest place of it is measured")
    normal: Place | None = Field(
        None, description="outward direction of the surface that is meant; where two lie close together"
    )
    radius_mm: Length = Field(description="the scan within this distance is taken together")

    @model_validator(mode="after")
    def _has_limits(self) -> Self:
        if not self.are_given:
            raise ValueError(f"point {self.name!r} has no limits; give tolerance_mm, or lower_mm or upper_mm")
        if self.normal is not None and not any(self.normal):
            raise ValueError(f"the normal of point {self.name!r} has no length")
        return self


class DistanceLimits(Limits):
    """Limits of how far the distance between two points is off that of the design."""

    name: Name = Field(description="of the distance, in the results")
    first: Name = Field(description="name of one of `points`")
    second: Name = Field(description="name of another")

    @model_validator(mode="after")
    def _has_limits(self) -> Self:
        if not self.are_given:
            raise ValueError(f"distance {self.name!r} has no limits; give tolerance_mm, lower_mm or upper_mm")
        return self


class Acceptance(SurfaceLimits):
    """What the part must satisfy. Without limits of its own, `options.tolerance_mm` is the limit."""

    min_coverage: Share | None = Field(
        None, description="share of the design's area that the scan must show, at least"
    )
    min_confidence: Share | None = Field(None, description="confidence of the verdict, at least")
    patch_mm: Length | None = Field(
        None,
        description="diameter of the patch over which deviations are taken together (median), so that no "
        "single vertex decides; null: 2 % of the design's size, or more where the scan is coarse",
    )
    uncertainty_mm: Length | None = Field(
        None,
        description="expanded uncertainty (k = 2) of the measurement: a value passes, or fails, only where "
        "it does so by more than this (ISO 14253-1); null: simple acceptance",
    )
    regions: list[RegionLimits] = Field([], max_length=MAX_REGIONS, description="regions with own limits")
    points: list[PointLimits] = Field([], max_length=MAX_POINTS, description="inspection points")
    distances: list[DistanceLimits] = Field(
        [], max_length=MAX_POINTS, description="distances between two of `points`"
    )

    def with_tolerance(self, tolerance_mm: float | None) -> "Acceptance":
        """The same; without limits for the whole part it has those of the job's tolerance.

        Raises
        ------
        ValueError
            When a share of the area is asked for, and there are no limits at all.
        """
        if self.are_given or tolerance_mm is None:
            if self.min_within is not None and not self.are_given:
                raise ValueError(WITHIN_WHAT)
            return self
        return self.model_copy(update={"tolerance_mm": tolerance_mm})

    @model_validator(mode="after")
    def _names(self) -> Self:
        points = [each.name for each in self.points]
        names = [*(each.name for each in self.regions), *points, *(each.name for each in self.distances)]
        if twice := sorted({name for name in names if names.count(name) > 1}):
            raise ValueError(f"the name {twice[0]!r} is given twice; names must differ")
        for distance in self.distances:
            for end in (distance.first, distance.second):
                if end not in points:
                    raise ValueError(f"distance {distance.name!r}: {end!r} is none of `points`")
            if distance.first == distance.second:
                raise ValueError(f"distance {distance.name!r} needs two different points")
        return self
