"""The verdict of a registration and its findings."""

from typing import Literal

from pydantic import Field

from pipeline.core.results.base import Record


class Finding(Record):
    """A reason for the verdict, or something a person should know whatever the status."""

    code: str = Field(description="stable code, as in the documented table of findings")
    detail: str = Field(description="the same for people, with figures")
    value: float | None = Field(description="the measured value; null where there is none")


VerdictStatus = Literal["ok", "units_suspect", "mirrored", "no_match", "under_constrained", "ambiguous"]


class Verdict(Record):
    status: VerdictStatus = Field(
        description="the first that applies, in the documented order; every status but `ok` needs a person"
    )
    confidence: float | None = Field(
        ge=0,
        le=1,
        description="probability that the pose is right, given the evidence; 0 without a pose",
    )
    findings: list[Finding] = Field(
        description="the reasons for the status, and what else a person should know"
    )
