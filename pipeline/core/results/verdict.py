"""The verdict of a registration and its findings."""

from typing import Literal

from pydantic import Field

from pipeline.core.results.base import Record


class Finding(Record):
    """A reason for the verdict, or something a person should know whatever the status."""

    code: str = Field(description="stable code, as in the documented table of findings")
    detail: str = Field(description="the same for people, with figures")
    value: float | None = Field(description="the measured value; null where there is none")


VerdictStatus = Literal[
    "ok", "units_suspect", "mirrored", "no_match", "under_constrained", "ambiguous", "uncertain"
]


class Evidence(Record):
    """One piece of what the two probabilities follow from: each is a logistic function of an intercept and
    the sum of value times weight.
    """

    name: str = Field(description="stable name, as in the documented table")
    of: Literal["same_part", "pose"] = Field(description="the probability that it counts for")
    value: float = Field(description="as measured")
    weight: float = Field(description="of the fitted model")
    contribution: float = Field(
        description="value minus its typical value for right poses, times the weight: below 0 it speaks "
        "against"
    )
    detail: str = Field(description="what it measures, for people")


class Verdict(Record):
    status: VerdictStatus = Field(
        description="the first that applies, in the documented order; every status but `ok` needs a person "
        "to check"
    )
    confidence: float | None = Field(
        ge=0,
        le=1,
        description="`same_part` times `pose`; 0 without a pose; null where settings differ from those that "
        "the models were fitted with",
    )
    same_part: float | None = Field(
        None, ge=0, le=1, description="probability that the scan is of this design, given the evidence"
    )
    pose: float | None = Field(
        None,
        ge=0,
        le=1,
        description="probability that the pose is right if it is, up to symmetries and free motions",
    )
    evidence: list[Evidence] = Field(
        default_factory=list, description="what the two probabilities follow from"
    )
    findings: list[Finding] = Field(
        description="the reasons for the status, and what else a person should know"
    )
