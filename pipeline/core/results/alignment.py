"""The alignment that the job asked for, beside the best fit."""

from typing import Literal

from pydantic import Field

from pipeline.core.results.base import Matrix4, Record, Vector3

AlignmentKind = Literal["best_fit", "constrained", "rps", "tolerance_fit", "landmarks"]


class FreeAlignmentMotion(Record):
    """A motion that the alignment does not determine."""

    kind: Literal["rotation", "translation", "screw"] = Field(description="type of the motion")
    axis: Vector3 = Field(description="unit vector, in the frame of the design")
    point_mm: Vector3 = Field(description="a point that the axis goes through")


class AlignedPoint(Record):
    """A reference point or a pair of points under both alignments."""

    name: str = Field(description="of the point or pair; of a landmark: its `id` in `landmarks.design`")
    position_mm: Vector3 = Field(description="on the design")
    best_fit_mm: float | None = Field(
        description="distance to it under the best fit: along the direction of a reference point (+ along "
        "it), or between the places of a pair; null: the scan does not show it"
    )
    value_mm: float | None = Field(description="the same under the alignment")
    n: int | None = Field(description="scan vertices that the value is the median of; null for a pair")


class AppliedAlignment(Record):
    """The alignment asked for. `transform`, deviations, inspection and files use it; verdict, metrics,
    landmark matches, observability and scale are of the best fit.
    """

    kind: AlignmentKind = Field(description="as in `options.alignment`")
    applied: bool = Field(
        description="false: it could not be made (`reason`), everything is of the best fit, and the part is "
        "not judged"
    )
    reason: str | None = Field(description="why it was not applied, for people; null if it was")
    residual_mm: float | None = Field(
        description="RMS of what the alignment makes small: distances of the fitted surface, of its points, "
        "or by how much the surface is beyond its limits; null if not applied"
    )
    best_fit_residual_mm: float | None = Field(description="the same under the best fit")
    best_fit_matrix: Matrix4 = Field(
        description="4x4, the automatic pose, which the verdict judges: p_design_mm = M @ p_scan_mm"
    )
    translation_mm: float = Field(
        description="by how much the alignment moves the middle of the scanned surface from the best fit"
    )
    angle_deg: float = Field(description="by how much it turns the part from the best fit")
    iterations: int = Field(description="steps made")
    free_motions: list[FreeAlignmentMotion] = Field(
        description="motions that it does not determine; they stay as in the best fit"
    )
    points: list[AlignedPoint] = Field(description="of `rps` and `landmarks`; empty for the others")
