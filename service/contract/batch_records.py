"""Answers about a batch of jobs."""

from datetime import datetime
from typing import Literal

from pydantic import Field

from pipeline import Decision
from service.contract.job_records import Status
from service.contract.model_base import Response


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
