"""Messages to the webhook of a job."""

from typing import Annotated

from fastapi import APIRouter, Path

from service.api.dependencies import UseApi
from service.api.identity import Reads, Writes
from service.api.parameters import JobId
from service.api.problems import problems
from service.contract.errors import DeliveryNotFound
from service.contract.schemas import NO_NUL, Delivery, DeliveryList
from service.webhooks.outbox import delivery_list, delivery_of

MessageId = Annotated[
    str, Path(description="`id` of the message", examples=["msg_01a2019a66857220"], pattern=NO_NUL)
]
router = APIRouter(prefix="/v1/jobs", tags=["jobs"])


@router.get("/{job_id}/deliveries", responses=problems(401, 403, 404, 429))
def list_deliveries(job_id: JobId, api: UseApi, caller: Reads) -> DeliveryList:
    """List the messages to the webhook of a job, with their delivery attempts."""
    return delivery_list(api.deliveries.of_job(api.job(job_id, caller).id))


@router.post(
    "/{job_id}/deliveries/{message}/redeliver", status_code=202, responses=problems(401, 403, 404, 429)
)
def redeliver(job_id: JobId, message: MessageId, api: UseApi, caller: Writes) -> Delivery:
    """Send a message to the webhook of a job again, also one that was given up or delivered."""
    row = api.deliveries.redeliver(api.job(job_id, caller).id, message)
    if row is None:
        raise DeliveryNotFound(
            f"job {job_id} has no message {message[:80]!r}; see /v1/jobs/{job_id}/deliveries"
        )
    return delivery_of(row)
