"""The table of all errors: exception class -> HTTP status and title. The `code` is on the class.

Code raises the error class, not a status; `problem_of` makes the RFC 9457 document. `openapi/examples/` has
one example of each error, and a test fails if a class has no row or no example.
"""

from dataclasses import dataclass
from typing import ClassVar

from pipeline import PipelineError
from pipeline import errors as mesh
from service.contract.schemas import Problem, ProblemItem

TYPE_PREFIX = "urn:cusp:problem:"


class ServiceError(Exception):
    """Base of the errors of the service. detail : which input, what is wrong, and what to do"""

    code: ClassVar[str] = "service_error"
    retry_after_s: int | None = None

    def __init__(self, detail: str, *, errors: list[ProblemItem] | None = None) -> None:
        self.detail = detail
        self.errors = errors
        super().__init__(detail)


class BadRequest(ServiceError):
    code = "bad_request"


class InvalidRequest(ServiceError):
    code = "invalid_request"


class InvalidOptions(ServiceError):
    code = "invalid_options"


class UnsupportedType(ServiceError):
    code = "unsupported_type"


class UnknownBlob(ServiceError):
    code = "unknown_blob"


class MeshNotFetched(ServiceError):
    code = "mesh_not_fetched"


class Unauthorized(ServiceError):
    code = "unauthorized"


class Forbidden(ServiceError):
    code = "forbidden"


class IdempotencyMismatch(ServiceError):
    code = "idempotency_mismatch"


class DigestMismatch(ServiceError):
    code = "digest_mismatch"


class NotFound(ServiceError):
    code = "not_found"


class MethodNotAllowed(ServiceError):
    code = "method_not_allowed"


class JobNotFound(ServiceError):
    code = "job_not_found"


class DeliveryNotFound(ServiceError):
    code = "delivery_not_found"


class FileNotInJob(ServiceError):
    code = "file_not_found"


class BatchNotFound(ServiceError):
    code = "batch_not_found"


class NoCharacteristics(ServiceError):
    code = "no_characteristics"


class PreconditionFailed(ServiceError):
    code = "precondition_failed"


class JobNotFinal(ServiceError):
    code = "job_not_final"
    retry_after_s: int | None = 1


class JobFinal(ServiceError):
    code = "job_final"


class JobDismissed(ServiceError):
    code = "job_dismissed"


class PayloadTooLarge(ServiceError):
    code = "payload_too_large"


class UnsupportedMediaType(ServiceError):
    code = "unsupported_media_type"


class RateLimited(ServiceError):
    code = "rate_limited"
    retry_after_s = 1


class TooManyWatchers(ServiceError):
    code = "too_many_watchers"
    retry_after_s = 5


class TenantQueueFull(ServiceError):
    code = "tenant_queue_full"
    retry_after_s = 30


class QueueFull(ServiceError):
    code = "queue_full"
    retry_after_s = 30


class QuotaExceeded(ServiceError):
    code = "quota_exceeded"
    retry_after_s = 300


class StorageFull(ServiceError):
    code = "storage_full"
    retry_after_s = 60


class NotReady(ServiceError):
    code = "not_ready"
    retry_after_s = 5


class InternalError(ServiceError):
    code = "internal_error"


class JobCrashed(ServiceError):
    code = "job_crashed"


class JobOutOfMemory(ServiceError):
    code = "job_out_of_memory"


class JobOutOfDisk(ServiceError):
    code = "job_out_of_disk"


class JobTimedOut(ServiceError):
    code = "job_timed_out"


@dataclass(frozen=True, slots=True)
class Row:
    """HTTP status and title of an error class."""

    status: int
    title: str


TABLE: dict[type[Exception], Row] = {
    # the request
    BadRequest: Row(400, "The request is malformed"),
    InvalidRequest: Row(422, "The request is invalid"),
    InvalidOptions: Row(422, "An option is invalid"),
    UnsupportedType: Row(422, "The job type is not supported"),
    UnknownBlob: Row(422, "The mesh is not stored"),
    MeshNotFetched: Row(422, "The mesh cannot be fetched from its address"),
    IdempotencyMismatch: Row(422, "The idempotency key belongs to another request"),
    DigestMismatch: Row(422, "The content does not match its digest"),
    PayloadTooLarge: Row(413, "The request is too large"),
    UnsupportedMediaType: Row(415, "The media type is not supported"),
    # the caller
    Unauthorized: Row(401, "A valid API key is needed"),
    Forbidden: Row(403, "The API key does not allow this"),
    RateLimited: Row(429, "Too many requests"),
    TooManyWatchers: Row(429, "This tenant watches too many jobs at once"),
    TenantQueueFull: Row(429, "Too many jobs of this tenant are waiting"),
    # the address
    NotFound: Row(404, "There is nothing at this address"),
    MethodNotAllowed: Row(405, "This address does not support the method"),
    JobNotFound: Row(404, "The job does not exist"),
    DeliveryNotFound: Row(404, "The webhook message does not exist"),
    FileNotInJob: Row(404, "The job has no such file"),
    BatchNotFound: Row(404, "The batch does not exist"),
    NoCharacteristics: Row(404, "The design has no characteristics"),
    PreconditionFailed: Row(412, "The document has changed"),
    JobNotFinal: Row(409, "The status of the job does not allow this"),
    JobFinal: Row(409, "The job has ended and cannot be cancelled"),
    JobDismissed: Row(409, "The job was dismissed and has no results"),
    # the server
    QueueFull: Row(503, "The queue is full"),
    QuotaExceeded: Row(507, "The storage quota of the tenant is used up"),
    StorageFull: Row(507, "The service has no storage space left"),
    NotReady: Row(503, "The service is not ready"),
    InternalError: Row(500, "Internal error"),
    # the child process of a job
    JobCrashed: Row(500, "The process of the job crashed"),
    JobOutOfMemory: Row(500, "The job exceeded its memory limit"),
    JobOutOfDisk: Row(500, "The job exceeded its disk limit"),
    JobTimedOut: Row(500, "The job exceeded its time limit"),
    # the meshes
    PipelineError: Row(422, "The meshes cannot be used"),
    mesh.EmptyFile: Row(422, "The file is empty"),
    mesh.UnknownFormat: Row(415, "The mesh format is unknown"),
    mesh.TruncatedFile: Row(422, "The file is truncated"),
    mesh.UnreadableFile: Row(422, "The file cannot be read"),
    mesh.MeshTooLarge: Row(413, "The mesh is too large"),
    mesh.NotFinite: Row(422, "The mesh has NaN or infinite coordinates"),
    mesh.CoordinateOutOfRange: Row(422, "The mesh has coordinates out of range"),
    mesh.IndexOutOfRange: Row(422, "A face refers to a vertex that does not exist"),
    mesh.NoSurface: Row(422, "The mesh has no triangles"),
    mesh.PartNotFound: Row(422, "The design file has no such part"),
    mesh.UnknownRegion: Row(422, "The design has no such region"),
    mesh.PointOffSurface: Row(422, "An inspection point is not on the design"),
    mesh.ColumnsUnfit: Row(422, "The point file does not have these columns"),
    mesh.UnitUnknown: Row(422, "The unit is unknown"),
    mesh.DegenerateMesh: Row(422, "The mesh has no usable surface"),
    mesh.TooFewPoints: Row(422, "The mesh has too few points"),
    mesh.ResampleFailed: Row(422, "The mesh cannot be resampled"),
    mesh.ComponentsTooSmall: Row(422, "Every component of the mesh is too small"),
    mesh.TooFewLandmarks: Row(422, "The mesh has too few landmarks for a study"),
}


def row_of(error: type[Exception]) -> Row:
    """The row of a class or of its nearest ancestor in the table; the row of InternalError for any other
    class.
    """
    return next((TABLE[base] for base in error.__mro__ if base in TABLE), TABLE[InternalError])


#: By code: `type`, `title` and `status` of a problem of this program.
PROBLEM_CODES: dict[str, tuple[str, str, int]] = {
    error.code: (TYPE_PREFIX + error.code, row.title, row.status)  # type: ignore[attr-defined]
    for error, row in TABLE.items()
}


def problem_of(error: PipelineError | ServiceError, *, instance: str | None = None) -> Problem:
    """The RFC 9457 document of an error."""
    row = row_of(type(error))
    about = (
        {"mesh": error.mesh, "stage": error.stage.value}
        if isinstance(error, PipelineError)
        else {"errors": error.errors}
    )
    return Problem.model_validate(
        {
            "type": TYPE_PREFIX + error.code,
            "title": row.title,
            "status": row.status,
            "detail": error.detail,
            "code": error.code,
            "instance": instance,
            **about,
        }
    )
