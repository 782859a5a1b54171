"""Answers about a job: its state, its meshes, its results and files."""

from datetime import datetime
from enum import StrEnum
from typing import Annotated, Literal

from pydantic import Field

from pipeline import (
    Decision,
    LandmarksResult,
    Reference,
    RegistrationResult,
    Stage,
    StudyResult,
    VerdictStatus,
)
from service.contract.model_base import BlobId, Response
from service.contract.problem import Problem

JobType = Literal["registration", "landmarks", "study"]


class Status(StrEnum):
    """Status of a job, in the words of OGC API Processes."""

    ACCEPTED = "accepted"  # stored and queued
    RUNNING = "running"  # a child process computes
    SUCCESSFUL = "successful"  # results are there (whatever the verdict)
    FAILED = "failed"  # `error` says why
    DISMISSED = "dismissed"  # cancelled by DELETE

    @property
    def is_final(self) -> bool:
        """True when the status can never change again."""
        return self in (Status.SUCCESSFUL, Status.FAILED, Status.DISMISSED)


class Blob(Response):
    """A stored mesh file."""

    id: BlobId
    size: int = Field(description="bytes")
    format: str = Field(
        description="format of the content: stl, ply, obj, off, 3mf, glb, xyz, step, las, e57, vtp, amf"
    )


class JobInput(Response):
    """A mesh of a job. Other jobs may name it: a design is sent once for many scans."""

    blob: BlobId | None = Field(description="its id; null for a `url` that is not fetched yet")
    filename: str | None = Field(description="as sent; null if none was sent")
    url: str | None = Field(
        None, description="where it was fetched from, without query (it may hold a signature); null otherwise"
    )


class JobInputs(Response):
    """The meshes of a job; null for those that its type does not have."""

    design: JobInput | None = Field(description="mesh of a `registration`")
    scan: JobInput | None = Field(description="mesh of a `registration`")
    mesh: JobInput | None = Field(description="mesh of a `landmarks` or `study` job")


class Links(Response):
    """Addresses that belong to a job."""

    self: str = Field(description="status")
    results: str = Field(description="results, once `successful`")
    files: str = Field(description="list of the files, once `successful`")


class Job(Response):
    """A job's status."""

    id: str = Field(description="UUIDv7; sorts by time of creation")
    type: JobType = Field(description="type of the job")
    status: Status = Field(description="status")
    stage: Stage | None = Field(description="the stage that runs; null before the job starts")
    progress: float = Field(
        ge=0, le=100, description="percent of the whole job; never decreases within an attempt"
    )
    message: str | None = Field(description="description of the stage")
    label: str | None = Field(description="as sent in `options`")
    verdict: VerdictStatus | None = Field(
        description="whether the pose is reliable, as in the results; null until `successful`, and for other "
        "types"
    )
    decision: Decision | None = Field(
        description="whether the part is accepted, as in the results; null until `successful`, and for other "
        "types"
    )
    within: float | None = Field(
        None,
        description="share of the scanned area within the tolerance, 0 to 1, as in the results; null until "
        "`successful`, without a tolerance or a pose, and for other types",
    )
    reference: Reference | None = Field(description="identity of the part, as sent in `options`")
    batch_id: str | None = Field(None, description="of the batch that it belongs to; null: none")
    inputs: JobInputs = Field(description="the meshes of the job")
    created: datetime = Field(description="when it was accepted")
    started: datetime | None = Field(description="when the latest attempt started")
    finished: datetime | None = Field(description="when it became final")
    attempt: int = Field(description="number of attempts; above 1 after a worker died or stopped")
    error: Problem | None = Field(description="why it failed; null otherwise")
    links: Links = Field(description="addresses of the job")

    @property
    def is_final(self) -> bool:
        """True when polling can stop."""
        return self.status.is_final


class JobForecast(Response):
    """How long a job has taken, and how long it will take."""

    elapsed_s: float = Field(
        ge=0, description="of a waiting job since it was accepted, of another since its attempt started"
    )
    place: int | None = Field(
        ge=1, description="place in the queue, 1 is the next to start; null unless the job is `accepted`"
    )
    remaining_s: float | None = Field(
        ge=0,
        description="estimate of the time until the job is final: a median, so half of such jobs take "
        "longer; 0 of a final job; null: no estimate, too few such jobs were seen, or none took so long",
    )
    based_on: int = Field(
        ge=0,
        description="recent successful jobs of this service that the estimate is from: of the same type, "
        "preset, settings and study, and of about the same size (bytes of the meshes within a factor of 2)",
    )


class JobPage(Response):
    """Jobs, newest first."""

    jobs: list[Job] = Field(description="the jobs of this page")
    next: str | None = Field(description="`cursor` of the next page; null on the last")


class FileEntry(Response):
    """A file of a successful job."""

    name: str = Field(description="as in `files` of the results")
    size: int = Field(description="bytes")
    sha256: str = Field(description="hex digest of the content")
    media_type: str = Field(description="media type of the content")
    href: str = Field(description="address of the content")


class FileList(Response):
    """The files of a successful job."""

    files: list[FileEntry] = Field(description="the files")


#: results.json as the pipeline writes it, by the type of the job.
Results = Annotated[RegistrationResult | LandmarksResult | StudyResult, Field(discriminator="type")]
