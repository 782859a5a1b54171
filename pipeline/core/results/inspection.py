"""The inspection: whether the part is accepted, check by check."""

from typing import Literal

from pydantic import Field

from pipeline.core.results.base import Record, Vector3

Decision = Literal["pass", "fail", "not_judged"]
CheckKind = Literal["highest", "lowest", "within", "coverage", "confidence", "point", "distance"]


class Check(Record):
    """One characteristic against its limits."""

    name: str = Field(description="of the point, distance or region with the kind; of the part: the kind")
    kind: CheckKind = Field(
        description="`highest`, `lowest`: deviation of the patch that stands out most, or lacks most; "
        "`within`: share of the area between the limits; `coverage`: share of the design's area that the "
        "scan shows; `confidence`: of the verdict; `point`: deviation at a point; `distance`: measured minus "
        "nominal"
    )
    region: str | None = Field(description="name of the region; null: the whole part, or a point")
    value: float | None = Field(description="as measured; null: the scan does not show it")
    lower: float | None = Field(description="limit; null: none")
    upper: float | None = Field(description="limit; null: none")
    unit: Literal["mm", "1"] = Field(description="of value and limits; `1`: a share")
    uncertainty: float | None = Field(
        description="standard error of the value, in the same unit: scatter of the scan and error of the "
        "alignment; 1.96 of it to both sides are its 95 % interval; null where it is not known"
    )
    n: int | None = Field(
        description="vertices of the scan that the value is of; null where none are counted"
    )
    passed: bool | None = Field(
        description="null: not measured, or too near a limit for the stated uncertainty"
    )
    position_mm: Vector3 | None = Field(description="where, in the design's frame; null: not at one place")


class Extreme(Record):
    """A place where the surface deviates most, over a patch of `patch_mm`."""

    position_mm: Vector3 = Field(description="on the design")
    value_mm: float = Field(description="median deviation of the patch; + outside the design")
    uncertainty_mm: float | None = Field(description="standard error of the value")
    segment: int = Field(description="of the design, that the place lies in")
    area_mm2: float = Field(description="connected area around it that deviates by at least half as much")


class Inspection(Record):
    """Whether the part is accepted. The verdict is about the alignment, this is about the part."""

    decision: Decision = Field(
        description="`pass`: the verdict is `ok` and every check passed; `fail`: a check failed, and the "
        "verdict is `ok`, or `uncertain` only because the part differs in a place; `not_judged`: anything "
        "else, see `reasons`"
    )
    reasons: list[str] = Field(description="why, for people; empty for `pass`")
    rule: str | None = Field(description="the decision rule; null without limits")
    patch_mm: float | None = Field(
        description="diameter of the patches over which deviations are taken; null without a pose"
    )
    checks: list[Check] = Field(description="each characteristic with its limits")
    extremes: list[Extreme] = Field(
        description="where the surface deviates most, largest first, to both sides; limits or not"
    )
