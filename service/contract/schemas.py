"""Requests and responses as pydantic models, shared by the OpenAPI document, the routes and the client."""

from datetime import datetime
from enum import StrEnum
from typing import Annotated, Any, Literal, Self

from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    JsonValue,
    ValidatorFunctionWrapHandler,
    WrapValidator,
    field_serializer,
    field_validator,
    model_validator,
)

from pipeline import (
    Acceptance,
    Alignment,
    Decision,
    LandmarksResult,
    PointColumns,
    Reference,
    RegistrationResult,
    Stage,
    StudyResult,
    StudySettings,
    Unit,
    VerdictStatus,
    limits_are_given,
)

BlobId = Annotated[str, Field(pattern=r"^sha256:[0-9a-f]{64}$", description="`sha256:` and 64 hex digits")]
MAX_BATCH = 1000  # scans of one batch
NO_NUL = r"^[^\x00]*$"  # PostgreSQL has no text with it
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


class Request(BaseModel):
    """Base of what clients send: an unknown key is an error, so that a typo is never silently ignored."""

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False)


class Response(BaseModel):
    """Base of what clients get: every field always present, unknown is null."""

    model_config = ConfigDict(allow_inf_nan=False)


class ProblemItem(Response):
    """One wrong value of a request."""

    pointer: str = Field(description="JSON Pointer (RFC 6901) to the wrong value in the request")
    detail: str = Field(description="what is wrong with it")


class Problem(BaseModel):
    """An error as RFC 9457 `application/problem+json`; there, members without a value are left out."""

    model_config = ConfigDict(extra="allow")

    type: str = Field(description="URN of the kind of problem; stable like `code`")
    title: str = Field(description="the kind of problem in a few words; the same for each `code`")
    status: int = Field(description="HTTP status")
    detail: str = Field(description="this case: which input, what is wrong, what to do")
    code: str = Field(description="stable identifier of the kind of problem")
    mesh: str | None = Field(None, description="the input it is about: `design`, `scan` or `mesh`")
    stage: str | None = Field(None, description="the stage of the method that failed")
    errors: list[ProblemItem] | None = Field(None, description="each wrong value of the request")
    instance: str | None = Field(
        None, description="id of this occurrence; quote it to the operator of the service"
    )


class Units(Request):
    """Length unit of each file. For a mesh that the job does not have, only `auto` is allowed."""

    design: Unit = Field(
        "auto", description="`auto`: as the file declares (GLB and E57 are in metres), else mm"
    )
    scan: Unit = Field("auto", description="as for `design`")
    mesh: Unit = Field("auto", description="as for `design`; of a `landmarks` or `study` job")


class Webhook(Request):
    """Receiver of a signed message when the job is final, by Standard Webhooks; repeated until it is
    accepted.
    """

    url: str = Field(
        max_length=2000, description="http(s) address; a private one only if the operator allows its network"
    )


class Options(Request):
    """Options of a job; all have defaults."""

    preset: Literal["default", "paper"] = Field(
        "default", description="the settings that `settings` modifies"
    )
    settings: dict[str, JsonValue] = Field(
        {}, description="any part of the Settings of the pipeline; replaces values of the preset"
    )
    units: Units = Field(Units(), description="unit of each file")
    tolerance_mm: float | None = Field(
        None,
        gt=0,
        description="`registration` only: limit of `deviation.within` and of the pose uncertainty (1 sigma)",
    )
    scan_accuracy_mm: float | None = Field(
        None,
        gt=0,
        description="`registration` only: accuracy of the scanner, one sigma, as its maker states it: how "
        "far a scan of a right part may lie off the design",
    )
    acceptance: Acceptance | None = Field(
        None,
        description="`registration` only: what the part must satisfy; `inspection` in the results says "
        "whether it does. Without limits of its own it takes `tolerance_mm`",
    )
    reference: Reference | None = Field(
        None,
        description="`registration` only: identity of the part; carried through, and searched by "
        "(`GET /v1/jobs?serial=`)",
    )
    alignment: Alignment | None = Field(
        None,
        description="`registration` only: how the scan lies on the design for deviation, inspection and "
        "files; null: as it fits best. The verdict is always about the best fit",
    )
    design_part: str | None = Field(
        None,
        min_length=1,
        max_length=300,
        pattern=NO_NUL,
        description="`registration` only: the part of the design file that was scanned, where it has several "
        "(build items of a 3MF, objects of an OBJ, solids of an STL, meshes of a glTF): name, number from 1, "
        "several numbers (`1,3`), or `all`, the default",
    )
    columns: str | None = Field(
        None,
        min_length=1,
        max_length=2000,
        pattern=NO_NUL,
        description="`registration` only: columns of a scan that is a text of points, where the text can be "
        "read in two ways: the name of each in order (`id,x,y,z`), or the numbers of x, y and z (`2,3,4`); "
        "then, where needed, `decimal=comma` or `decimal=point`, and `delimiter=` `space`, `tab`, `comma`, "
        "`semicolon` or `pipe`",
    )
    study: StudySettings | None = Field(
        None, description="`study` only: what to measure; each key replaces one of `settings.study`"
    )
    seed: int = Field(0, ge=0, lt=2**32, description="seed of every random draw")
    label: str | None = Field(
        None, max_length=200, pattern=NO_NUL, description="free text of the client, to find the job again"
    )
    webhook: Webhook | None = Field(None, description="receiver of a message when the job is final")

    @field_validator("columns")
    @classmethod
    def _columns_known(cls, columns: str | None) -> str | None:
        if columns is not None:
            PointColumns.of(columns)
        return columns

    @model_validator(mode="after")
    def _limits_are_there(self) -> Self:
        if self.acceptance is not None:
            try:
                self.acceptance.with_tolerance(self.tolerance_mm)
            except ValueError as error:
                raise ValueError(f"acceptance: {error}") from error
        if not limits_are_given(self.alignment, self.acceptance, self.tolerance_mm):
            raise ValueError("alignment: a tolerance_fit needs limits: its own, acceptance or tolerance_mm")
        return self

    @field_serializer("study")
    def _study_as_sent(self, study: StudySettings | None) -> dict[str, Any] | None:
        """Only the keys that were sent; the others come from the preset and the settings."""
        return None if study is None else study.model_dump(mode="json", exclude_unset=True)


class BlobRef(Request):
    """A mesh stored by `PUT /v1/blobs`."""

    blob: BlobId
    filename: str | None = Field(None, max_length=255, description="used to detect the format only")


class UrlRef(Request):
    """A mesh at a web address, which the service fetches when the job starts; presigned addresses too."""

    url: str = Field(
        max_length=4000,
        description="http(s) address; a private one only if the operator allows its network",
    )
    sha256: str | None = Field(
        None, pattern=r"^[0-9a-f]{64}$", description="hex digest that the content must have"
    )
    filename: str | None = Field(
        None, max_length=255, description="used to detect the format only; null: the end of the address"
    )


def _by_its_keys(value: Any, either: ValidatorFunctionWrapHandler) -> Any:
    """As one of the two, so that an error is about the one that is meant. Null counts as not given: the
    `inputs` of a job may be sent again.
    """
    if not isinstance(value, dict):
        return either(value)
    given = {key: each for key, each in value.items() if each is not None}
    return (UrlRef if "url" in given and "blob" not in given else BlobRef).model_validate(given)


MeshRef = Annotated[BlobRef | UrlRef, WrapValidator(_by_its_keys)]


class RegistrationRequest(Request):
    """Register a scan to its design and measure the deviation."""

    type: Literal["registration"] = Field("registration", description="what to do")
    design: MeshRef = Field(description="the design mesh")
    scan: MeshRef = Field(description="the scan mesh, or points")
    options: Options = Field(Options(), description="how to run the job")


class LandmarksRequest(Request):
    """Segments and landmarks of one mesh."""

    type: Literal["landmarks"] = Field(description="what to do")
    mesh: MeshRef = Field(description="the mesh")
    options: Options = Field(Options(), description="how to run the job")


class StudyRequest(Request):
    """How informative the landmarks of one mesh are, or how repeatable on another mesh of its shape."""

    type: Literal["study"] = Field(description="what to do")
    mesh: MeshRef = Field(description="the mesh")
    options: Options = Field(Options(), description="how to run the job; `study` says what to do")


#: A job on blobs; a multipart request carries the same as its parts.
JobRequest = RegistrationRequest | LandmarksRequest | StudyRequest


class BatchScan(Request):
    """One scan of a batch."""

    scan: MeshRef = Field(description="the scan mesh, or points")
    reference: Reference | None = Field(
        None, description="identity of this part; over `options.reference` of the batch, key by key"
    )
    label: str | None = Field(
        None, max_length=200, pattern=NO_NUL, description="of this job; null: that of `options`"
    )


class BatchRequest(Request):
    """Register many scans to one design."""

    design: MeshRef = Field(description="the design mesh")
    scans: list[BatchScan] = Field(min_length=1, max_length=MAX_BATCH, description="a job for each")
    options: Options = Field(Options(), description="of every job; without a webhook")
    label: str | None = Field(
        None, max_length=200, pattern=NO_NUL, description="free text, to find the batch again"
    )
    webhook: Webhook | None = Field(None, description="receiver of one message, when every job is final")

    @model_validator(mode="after")
    def _one_message(self) -> Self:
        if self.options.webhook is not None:
            raise ValueError("options.webhook: a batch sends one message; give `webhook` beside `options`")
        return self


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


class BatchLinks(Response):
    """Addresses that belong to a batch."""

    self: str = Field(description="status")
    jobs: str = Field(description="its jobs")
    table: str = Field(description="a CSV row for each scan")
    deliveries: str = Field(description="the message to its webhook")


class Batch(Response):
    """The state of a batch."""

    id: str = Field(description="UUIDv7; sorts by time of creation")
    label: str | None = Field(description="as sent")
    status: Literal["accepted", "running", "finished"] = Field(
        description="`finished`: every job is final, whatever became of it"
    )
    total: int = Field(description="number of scans")
    by_status: dict[Status, int] = Field(description="number of jobs by status")
    by_verdict: dict[str, int] = Field(description="number of successful jobs by verdict on the alignment")
    by_decision: dict[Decision, int] = Field(description="number of successful jobs by decision on the part")
    created: datetime = Field(description="when it was accepted")
    finished: datetime | None = Field(description="when its last job became final")
    links: BatchLinks = Field(description="addresses of the batch")


class BatchPage(Response):
    """Batches, newest first."""

    batches: list[Batch] = Field(description="the batches of this page")
    next: str | None = Field(description="`cursor` of the next page; null on the last")


class JobPage(Response):
    """Jobs, newest first."""

    jobs: list[Job] = Field(description="the jobs of this page")
    next: str | None = Field(description="`cursor` of the next page; null on the last")


class DeliveryState(StrEnum):
    """State of a message to a webhook."""

    WAITING = "waiting"  # for its first or next attempt
    DELIVERED = "delivered"  # the receiver answered 2xx
    GIVEN_UP = "given_up"  # after the last attempt, after 410 Gone, or because the address is forbidden


class DeliveryAttempt(Response):
    """One attempt to deliver a message."""

    at: datetime = Field(description="when")
    status: int | None = Field(description="HTTP status of the answer; null if there was none")
    error: str | None = Field(description="why there was no answer")
    seconds: float = Field(description="duration")


class Delivery(Response):
    """A message to a job's webhook."""

    id: str = Field(description="`webhook-id` of the message; the same in every attempt")
    job: str = Field(description="`id` of the job, or of the batch")
    event: str = Field(
        description="`job.successful`, `job.failed` or `job.dismissed`; of a batch `batch.finished`"
    )
    url: str = Field(description="address of the receiver")
    state: DeliveryState = Field(description="state of the message")
    next: datetime | None = Field(description="when the next attempt is due; null if there is none")
    attempts: list[DeliveryAttempt] = Field(description="the attempts, oldest first")


class DeliveryList(Response):
    """Messages to webhooks."""

    deliveries: list[Delivery] = Field(description="the messages")


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


class Limits(Response):
    """What this server accepts."""

    max_upload_mib: int = Field(description="largest request body")
    job_time_limit_s: float = Field(description="a job that runs longer fails with job_timed_out")
    job_memory_limit_mib: int = Field(description="a job that takes more memory fails with job_out_of_memory")
    job_disk_limit_mib: int = Field(description="a job that takes more disk space fails with job_out_of_disk")
    queue_limit: int = Field(description="limit of waiting jobs; beyond it, jobs are refused with queue_full")
    tenant_queue_limit: int = Field(
        description="limit of waiting jobs of one tenant; beyond it, jobs are refused with tenant_queue_full"
    )
    tenant_quota_mib: int = Field(
        description="limit of stored meshes and results of a tenant; beyond it, uploads and jobs are refused "
        "with quota_exceeded; 0: no limit"
    )
    tenant_stored_mib: float = Field(description="meshes and results that the caller's tenant has stored")
    rate_limit_per_s: int = Field(
        description="limit of requests per second of one key or address; 0: no limit"
    )
    parallel_jobs: int = Field(description="jobs that run at the same time")
    job_types: list[str] = Field(description="values of `type` that this version supports")
    formats: list[str] = Field(description="supported mesh formats")
    setting_ceilings: dict[str, float] = Field(
        description="how far `options.settings` may raise a setting (`section.name`); beyond: invalid_options"
    )


class SandboxMeasures(Response):
    """How jobs are confined, on the machine that answers."""

    landlock: int = Field(description="version of Landlock; 0: the kernel has none or does not allow it")
    system_calls_filtered: bool = Field(description="by seccomp")
    missing: list[str] = Field(description="what is not confined; empty: everything is")


class Version(Response):
    """Version of the service."""

    name: Literal["cusp"] = Field("cusp", description="of the service")
    version: str = Field(description="of Cusp")
    schema_version: Literal["1"] = Field("1", description="of the results")
    sandbox: SandboxMeasures = Field(description="how jobs are confined")


class Health(Response):
    """Answer of the probes."""

    status: Literal["ok"] = Field("ok", description="ready; otherwise the answer is a problem")


#: results.json as the pipeline writes it, by the type of the job.
Results = Annotated[RegistrationResult | LandmarksResult | StudyResult, Field(discriminator="type")]
