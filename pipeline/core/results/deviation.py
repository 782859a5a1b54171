"""Distributions of signed distances between scan and design."""

from typing import Literal

from pydantic import Field

from pipeline.core.results.base import Record


class Spread(Record):
    """A distribution of signed distances, area-weighted, so that rms^2 = mean^2 + sd^2."""

    n: int = Field(description="vertices counted")
    mean_mm: float = Field(description="weighted mean of the signed distances")
    sd_mm: float = Field(description="standard deviation, ddof 0")
    rms_mm: float = Field(description="root mean square")
    min_mm: float = Field(description="the lowest: material is missing")
    max_mm: float = Field(description="the highest: excess material")


class SegmentDeviation(Spread):
    segment: int = Field(description="number of the segment of the design that the vertices lie closest to")


class Distances(Spread):
    """The same with quantiles (the smallest distance that the share reaches), and shares of the area by
    tolerance.
    """

    mean_abs_mm: float = Field(description="weighted mean of the absolute distances")
    p01_mm: float = Field(description="1 % of the area is at most here")
    p05_mm: float = Field(description="5 % of the area is at most here")
    p50_mm: float = Field(description="median")
    p95_mm: float = Field(description="95 % of the area is at most here")
    p99_mm: float = Field(description="99 % of the area is at most here")
    tolerance_mm: float | None = Field(description="as given in `options`; null: none was given")
    within: float | None = Field(description="share of the area within +- tolerance_mm; null without one")
    above: float | None = Field(description="share of the area above + tolerance_mm; null without one")
    below: float | None = Field(description="share of the area below - tolerance_mm; null without one")


DesignSide = Literal["closed", "open", "none"]


class Deviation(Distances):
    """Distance of every scan vertex to the surface of the design, + outside; those at an open border are left
    out.
    """

    sign: DesignSide = Field(
        description="`closed`: + is outside the design; `open`: + is the side its normals point to; `none`: "
        "its faces "
        "have no consistent orientation, so distances are unsigned"
    )
    by_segment: list[SegmentDeviation] = Field(description="by the segment of the design")


class DesignDeviation(Distances):
    """The other direction: distance of design vertices to the scan, + where the scan stands out of the design
    there.

    It shows what no scan vertex lies near: a piece that broke off, a hole that was filled. Design vertices
    that the scan does not cover (closest point on an open border of the scan; for a point cloud, beyond the
    inlier distance) are not counted.
    """

    seen: float = Field(description="share of the area of the design that is counted")
