"""How the scan is aligned for deviation and inspection, as the drawing of the part says.

Every alignment starts from the automatic pose, which the verdict judges. Places and directions are in the
design's frame, in mm.
"""

from typing import Annotated, Literal, Self

from pydantic import Field, TypeAdapter, model_validator

from pipeline.core.acceptance import Acceptance, Length, Limits, Name, OptionPart, Place, Region
from pipeline.core.small_motions import free_motions

Direction = Annotated[list[float], Field(min_length=3, max_length=3, description="any length above 0")]
Weight = Annotated[float, Field(ge=0, le=1e6)]
HeldMotion = Literal["tx", "ty", "tz", "rx", "ry", "rz"]
#: Regions and points of one alignment, at most: limits time and the size of the results.
MAX_FIT_REGIONS, MAX_ALIGNMENT_POINTS = 200, 1000


class FitRegion(OptionPart):
    """A part of the design's surface that the scan is fitted to."""

    region: Region = Field(description="which part of the design's surface")
    weight: Weight = Field(1.0, description="how much its area counts, against that of the others")


class _Fitted(OptionPart):
    regions: list[FitRegion] = Field(
        [], max_length=MAX_FIT_REGIONS, description="what is fitted; empty: the whole surface"
    )
    other_weight: Weight = Field(0.0, description="how much area outside `regions` counts")

    @model_validator(mode="after")
    def _something_counts(self) -> Self:
        if self.regions and self.other_weight == 0 and not any(each.weight for each in self.regions):
            raise ValueError("every weight is 0; give a region, or other_weight, a weight above 0")
        return self


class BestFit(_Fitted):
    """Least squares of the distances to the surface; without regions it is the automatic pose itself."""

    kind: Literal["best_fit"] = Field(description="kind of the alignment")


class GuideLine(OptionPart):
    """A line that the part may turn about and slide along."""

    point_mm: Place = Field(description="on the line")
    direction: Direction = Field(description="of the line")


class GuidePlane(OptionPart):
    """A plane that the part may slide and turn in."""

    normal: Direction = Field(description="across the plane")


class ConstrainedFit(_Fitted):
    """Best fit with some motions held as they are in the automatic pose: give `hold`, `line` or `plane`."""

    kind: Literal["constrained"] = Field(description="kind of the alignment")
    hold: list[HeldMotion] | None = Field(
        None,
        min_length=1,
        max_length=5,
        description="translations along (`tx`) and rotations about (`rx`) the axes of the design that are "
        "held",
    )
    about_mm: Place | None = Field(
        None, description="with `hold`: the point whose translations are held; null: the design's origin"
    )
    line: GuideLine | None = Field(None, description="only turns about it and slides along it")
    plane: GuidePlane | None = Field(None, description="only slides and turns in it")

    @model_validator(mode="after")
    def _one_of_three(self) -> Self:
        if sum(each is not None for each in (self.hold, self.line, self.plane)) != 1:
            raise ValueError("give exactly one of hold, line and plane")
        if self.about_mm is not None and self.hold is None:
            raise ValueError("about_mm goes with hold")
        if self.hold is not None and len(set(self.hold)) < len(self.hold):
            raise ValueError("hold names a motion twice")
        for direction in (self.line and self.line.direction, self.plane and self.plane.normal):
            if direction is not None and not any(direction):
                raise ValueError("the direction has no length")
        return self


class RpsPoint(OptionPart):
    """A place where the scan must lie on the design, along one direction."""

    name: Name = Field(description="of the point, in the results")
    position_mm: Place = Field(description="on the design's surface; the nearest place of it is taken")
    direction: Direction = Field(description="along which the point is held, across its surface")
    radius_mm: Length = Field(description="the scan within this distance is taken together (median)")


class RpsFit(OptionPart):
    """Reference points: six of them (3-2-1) lie on the design exactly; more are fitted by least squares."""

    kind: Literal["rps"] = Field(description="kind of the alignment")
    points: list[RpsPoint] = Field(
        min_length=1, max_length=MAX_ALIGNMENT_POINTS, description="six or more, that hold every motion"
    )

    @model_validator(mode="after")
    def _hold_every_motion(self) -> Self:
        names = [each.name for each in self.points]
        if twice := sorted({name for name in names if names.count(name) > 1}):
            raise ValueError(f"the name {twice[0]!r} is given twice; names must differ")
        if still := [each.name for each in self.points if not any(each.direction)]:
            raise ValueError(f"the direction of point {still[0]!r} has no length")
        free = free_motions(
            [each.position_mm for each in self.points], [each.direction for each in self.points]
        )
        if free:
            motions = "; ".join(str(motion) for motion in free)
            raise ValueError(f"the points leave a motion free: {motions}. Add points that hold it")
        return self


class ToleranceFit(Limits):
    """As much of the surface as possible within its limits: those given here, or of `options.acceptance`
    with its regions, or `options.tolerance_mm`.
    """

    kind: Literal["tolerance_fit"] = Field(description="kind of the alignment")


class LandmarkPair(OptionPart):
    """A place of the design and the place of the scan that belongs on it."""

    name: Name = Field(description="of the pair, in the results")
    design_mm: Place = Field(description="in the frame of the design")
    scan_mm: Place = Field(description="in the frame of the scan, mm")


class LandmarksFit(OptionPart):
    """Least squares of pairs of points: those given, or the landmarks that were matched."""

    kind: Literal["landmarks"] = Field(description="kind of the alignment")
    pairs: list[LandmarkPair] = Field(
        [],
        max_length=MAX_ALIGNMENT_POINTS,
        description="three or more, not on one line; empty: the matched landmarks",
    )
    design_landmarks: list[Annotated[int, Field(ge=0)]] | None = Field(
        None,
        min_length=3,
        max_length=MAX_ALIGNMENT_POINTS,
        description="instead of pairs: `id` of those of `landmarks.design` that are used; null: all that are "
        "matched",
    )

    @model_validator(mode="after")
    def _hold_every_motion(self) -> Self:
        if not self.pairs:
            return self
        if self.design_landmarks is not None:
            raise ValueError("give pairs or design_landmarks, not both")
        names = [each.name for each in self.pairs]
        if twice := sorted({name for name in names if names.count(name) > 1}):
            raise ValueError(f"the name {twice[0]!r} is given twice; names must differ")
        for frame in ("design_mm", "scan_mm"):
            places = [getattr(each, frame) for each in self.pairs for _ in range(3)]
            axes = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]] * len(self.pairs)
            if free := free_motions(places, axes):
                motions = "; ".join(str(motion) for motion in free)
                raise ValueError(
                    f"the places {frame} leave a motion free: {motions}. Add a pair off the line"
                )
        return self


Alignment = Annotated[
    BestFit | ConstrainedFit | RpsFit | ToleranceFit | LandmarksFit, Field(discriminator="kind")
]


def parse_alignment(document: object) -> Alignment:
    """The alignment of its JSON. Raises pydantic.ValidationError."""
    parsed: Alignment = TypeAdapter(Alignment).validate_python(document)
    return parsed


def limits_are_given(
    alignment: Alignment | None, acceptance: Acceptance | None, tolerance_mm: float | None
) -> bool:
    """False for a tolerance fit without any limits."""
    if not isinstance(alignment, ToleranceFit) or alignment.are_given or tolerance_mm is not None:
        return True
    return acceptance is not None and (
        acceptance.are_given or any(region.are_given for region in acceptance.regions)
    )
