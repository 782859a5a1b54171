"""The results of each type of job, as results.json holds them."""

from typing import Literal

from pydantic import Field

from pipeline.core.reference import Reference
from pipeline.core.results.alignment import AppliedAlignment
from pipeline.core.results.base import Note, Record
from pipeline.core.results.deviation import DesignDeviation, Deviation
from pipeline.core.results.inspection import Inspection
from pipeline.core.results.mesh import Landmarks, LandmarksOfMesh, SegmentsOfMesh, SegmentsPair
from pipeline.core.results.pose import (
    Alternative,
    Metrics,
    Observability,
    Scale,
    ScanQuality,
    Symmetry,
    Transform,
)
from pipeline.core.results.provenance import OneProvenance, Provenance
from pipeline.core.results.study import (
    InformativenessProtocol,
    InformativenessRow,
    RepeatabilityProtocol,
    RepeatabilityRow,
)
from pipeline.core.results.verdict import Verdict


class RegistrationResult(Record):
    """What a registration job found. Read `verdict.status` first; `transform` is null without a valid
    alignment.
    """

    schema_version: Literal["1"] = Field(
        "1", description="of this document; fields are only added within a version"
    )
    type: Literal["registration"] = Field("registration", description="type of the job")
    verdict: Verdict = Field(description="whether the pose is reliable; read this first")
    transform: Transform | None = Field(
        description="the pose of the scan on the design, by `alignment` where one was asked for; null: no "
        "valid alignment was found"
    )
    alignment: AppliedAlignment | None = Field(
        None,
        description="the alignment asked for, beside the best fit; null: none was, or there is no pose",
    )
    alternatives: list[Alternative] = Field(
        description="other poses that fit, and symmetry-equivalent poses; for `no_match` and `mirrored` the "
        "rejected poses"
    )
    symmetry: Symmetry | None = Field(
        None, description="of the design, as the pose may use it; null without a pose or a symmetry"
    )
    metrics: Metrics = Field(description="RMSEs, fitness, overlap")
    landmarks: Landmarks = Field(description="of both meshes, and their matches")
    segments: SegmentsPair = Field(description="of both meshes")
    deviation: Deviation | None = Field(description="of the scan from the design; null without a pose")
    deviation_of_design: DesignDeviation | None = Field(
        description="of the design from the scan; null without a pose, or where the scan shows none of it"
    )
    inspection: Inspection | None = Field(
        None, description="is the part accepted; null in results of earlier versions"
    )
    reference: Reference | None = Field(None, description="identity of the part, as sent in `options`")
    observability: Observability | None = Field(
        description="which motions the data constrains; null without a pose"
    )
    scale: Scale | None = Field(description="diagnosis of size and warp; null without a pose")
    scan: ScanQuality | None = Field(
        None, description="noise and accuracy of the scan; null in results before version 0.2"
    )
    provenance: Provenance = Field(description="inputs, versions, settings and limits")
    timings_s: dict[str, float] = Field(
        description="seconds by stage; the only part that differs between identical runs"
    )
    files: list[str] = Field(description="names of the files beside this one")
    warnings: list[Note] = Field(description="what a person should know; none of them stopped the job")


class SegmentsResult(Record):
    """What `find_segments` found in one mesh. The centres' `vertex` is one of `mesh.segments.ply`."""

    schema_version: Literal["1"] = Field(
        "1", description="of this document; fields are only added within a version"
    )
    type: Literal["segments"] = Field("segments", description="type of the job")
    segments: SegmentsOfMesh = Field(description="of the mesh")
    provenance: OneProvenance = Field(description="inputs, versions, settings and limits")
    timings_s: dict[str, float] = Field(
        description="seconds by stage; the only part that differs between identical runs"
    )
    files: list[str] = Field(description="names of the files beside this one")
    warnings: list[Note] = Field(description="what a person should know; none of them stopped the job")


class LandmarksResult(Record):
    """What a landmarks job found in one mesh."""

    schema_version: Literal["1"] = Field(
        "1", description="of this document; fields are only added within a version"
    )
    type: Literal["landmarks"] = Field("landmarks", description="type of the job")
    segments: SegmentsOfMesh = Field(description="of the mesh")
    landmarks: LandmarksOfMesh = Field(description="of the mesh")
    provenance: OneProvenance = Field(description="inputs, versions, settings and limits")
    timings_s: dict[str, float] = Field(
        description="seconds by stage; the only part that differs between identical runs"
    )
    files: list[str] = Field(description="names of the files beside this one")
    warnings: list[Note] = Field(description="what a person should know; none of them stopped the job")


class StudyResult(Record):
    """What a study found: the protocol, one row a detector (and ICP protocol or condition), in words."""

    schema_version: Literal["1"] = Field(
        "1", description="of this document; fields are only added within a version"
    )
    type: Literal["study"] = Field("study", description="type of the job")
    protocol: InformativenessProtocol | RepeatabilityProtocol = Field(
        discriminator="kind", description="the protocol of the study"
    )
    informativeness: list[InformativenessRow] | None = Field(description="null for the other kind of study")
    repeatability: list[RepeatabilityRow] | None = Field(description="null for the other kind of study")
    summary: str = Field(description="one paragraph for people")
    provenance: OneProvenance = Field(description="inputs, versions, settings and limits")
    timings_s: dict[str, float] = Field(
        description="seconds by stage; the only part that differs between identical runs"
    )
    files: list[str] = Field(description="names of the files beside this one")
    warnings: list[Note] = Field(description="what a person should know; none of them stopped the job")
