"""Bodies of requests: a job, or a batch of jobs."""

from typing import Annotated, Any, Literal, Self

from pydantic import Field, ValidatorFunctionWrapHandler, WrapValidator, model_validator

from pipeline import Reference
from service.contract.job_options import Options, Webhook
from service.contract.model_base import NO_NUL, SHA256, BlobId, Request

MAX_BATCH = 1000  # scans of one batch


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
    sha256: str | None = Field(None, pattern=SHA256, description="hex digest that the content must have")
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
