"""Requests and answers as pydantic models, shared by the OpenAPI document, the routes and the client."""

from service.contract.batch_records import Batch, BatchLinks, BatchPage
from service.contract.delivery_records import Delivery, DeliveryAttempt, DeliveryList, DeliveryState
from service.contract.job_options import Options, Units, Webhook
from service.contract.job_records import (
    Blob,
    FileEntry,
    FileList,
    Job,
    JobForecast,
    JobInput,
    JobInputs,
    JobPage,
    JobType,
    Links,
    Results,
    Status,
)
from service.contract.model_base import NO_NUL, BlobId, Request, Response
from service.contract.problem import Problem, ProblemItem
from service.contract.requests import (
    MAX_BATCH,
    BatchRequest,
    BatchScan,
    BlobRef,
    JobRequest,
    LandmarksRequest,
    MeshRef,
    RegistrationRequest,
    StudyRequest,
    UrlRef,
)
from service.contract.server_records import Health, Limits, SandboxMeasures, Version

__all__ = [
    "MAX_BATCH",
    "NO_NUL",
    "Batch",
    "BatchLinks",
    "BatchPage",
    "BatchRequest",
    "BatchScan",
    "Blob",
    "BlobId",
    "BlobRef",
    "Delivery",
    "DeliveryAttempt",
    "DeliveryList",
    "DeliveryState",
    "FileEntry",
    "FileList",
    "Health",
    "Job",
    "JobForecast",
    "JobInput",
    "JobInputs",
    "JobPage",
    "JobRequest",
    "JobType",
    "LandmarksRequest",
    "Limits",
    "Links",
    "MeshRef",
    "Options",
    "Problem",
    "ProblemItem",
    "RegistrationRequest",
    "Request",
    "Response",
    "Results",
    "SandboxMeasures",
    "Status",
    "StudyRequest",
    "Units",
    "UrlRef",
    "Version",
    "Webhook",
]
