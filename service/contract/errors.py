"""The one table of what can go wrong: exception class -> HTTP status and title; `code` is on the class.

Whoever raises says what happened, never a number; `problem_of` turns it into RFC 9457. The README prints the
table, `openapi/examples/` has one example of each, and a test fails when a class has no row or no example.
"""

from dataclasses import dataclass
from typing import ClassVar

from pipeline import PipelineError
from pipeline import errors as mesh
from service.contract.schemas import Problem, ProblemItem

TYPE_PREFIX = "urn:cusp:problem:"


class ServiceError(Exception):
    """Base of what the service itself raises on purpose; `detail` says which input, what is wrong, what to do."""

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


class FileNotInJob(ServiceError):
    code = "file_not_found"


class JobNotFinal(ServiceError):
    code = "job_not_final"
    retry_after_s = 1


class JobDismissed(ServiceError):
    code = "job_dismissed"


class PayloadTooLarge(ServiceError):
    code = "payload_too_large"


class UnsupportedMediaType(ServiceError):
    code = "unsupported_media_type"


class RateLimited(ServiceError):
    code = "rate_limited"
    retry_after_s = 1


class TenantQueueFull(ServiceError):
    code = "tenant_queue_full"
    retry_after_s = 30


class QueueFull(ServiceError):
    code = "queue_full"
    retry_after_s = 30


class NotReady(ServiceError):
    code = "not_ready"
    retry_after_s = 5


class InternalError(ServiceError):
    code = "internal_error"


class JobCrashed(ServiceError):
    code = "job_crashed"


class JobOutOfMemory(ServiceError):
    code = "job_out_of_memory"


class JobTimedOut(ServiceError):
    code = "job_timed_out"


@dataclass(frozen=True, slots=True)
class Row:
    """How a class is told to a client."""

    status: int
    title: str


TABLE: dict[type[Exception], Row] = {
    # the request
    BadRequest: Row(400, "The request cannot be read"),
    InvalidRequest: Row(422, "The request is not what this address takes"),
    InvalidOptions: Row(422, "An option is wrong"),
    UnsupportedType: Row(422, "This version does not run this type of job"),
    UnknownBlob: Row(422, "The blob is not stored here"),
    IdempotencyMismatch: Row(422, "The idempotency key was used for another request"),
    DigestMismatch: Row(422, "The content is not what its digest says"),
    PayloadTooLarge: Row(413, "The request is too large"),
    UnsupportedMediaType: Row(415, "The media type is not supported"),
    # who asks
    Unauthorized: Row(401, "An API key is needed"),
    Forbidden: Row(403, "The API key does not allow this"),
    RateLimited: Row(429, "Too many requests"),
    TenantQueueFull: Row(429, "Too many jobs of yours wait"),
    # the address
    NotFound: Row(404, "Nothing is at this address"),
    MethodNotAllowed: Row(405, "The method is not allowed here"),
    JobNotFound: Row(404, "There is no such job"),
    FileNotInJob: Row(404, "The job has no such file"),
    JobNotFinal: Row(409, "The job has no results yet"),
    JobDismissed: Row(409, "The job was dismissed and has no results"),
    # the server
    QueueFull: Row(503, "The queue is full"),
    NotReady: Row(503, "The service cannot take jobs now"),
    InternalError: Row(500, "The service failed"),
    # the child process of a job
    JobCrashed: Row(500, "The job's process died"),
    JobOutOfMemory: Row(500, "The job took more memory than it may"),
    JobTimedOut: Row(500, "The job took longer than it may"),
    # the meshes
    PipelineError: Row(422, "The meshes cannot be used"),
    mesh.EmptyFile: Row(422, "The file is empty"),
    mesh.UnknownFormat: Row(415, "The mesh format is not known"),
    mesh.TruncatedFile: Row(422, "The file is cut short"),
    mesh.UnreadableFile: Row(422, "The file cannot be read"),
    mesh.MeshTooLarge: Row(413, "The mesh is too large"),
    mesh.NotFinite: Row(422, "The mesh has coordinates that are no numbers"),
    mesh.CoordinateOutOfRange: Row(422, "The mesh has coordinates that no part has"),
    mesh.IndexOutOfRange: Row(422, "The mesh refers to vertices it does not have"),
    mesh.NoSurface: Row(422, "The mesh has no triangles"),
    mesh.UnitUnknown: Row(422, "The unit is not known"),
    mesh.DegenerateMesh: Row(422, "The mesh has no usable surface"),
    mesh.TooFewPoints: Row(422, "The mesh has too few points"),
    mesh.ResampleFailed: Row(422, "The mesh cannot be resampled"),
    mesh.ComponentsTooSmall: Row(422, "Every piece of the mesh is too small"),
    mesh.TooFewLandmarks: Row(422, "The mesh has too little to mark for a study"),
}


def row_of(error: type[Exception]) -> Row:
    """The row of a class or of its nearest ancestor that has one; anything unforeseen is an InternalError."""
    return next((TABLE[base] for base in error.__mro__ if base in TABLE), TABLE[InternalError])


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
