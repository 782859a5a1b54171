"""Answers about messages to webhooks."""

from datetime import datetime
from enum import StrEnum

from pydantic import Field

from service.contract.model_base import Response


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
