"""Messages to the webhooks of a tenant, of all its jobs."""

from typing import Annotated

from fastapi import APIRouter, Query

from service.api.dependencies import UseApi
from service.api.identity import Reads
from service.api.problems import problems
from service.contract.model_base import MESSAGE_CURSOR
from service.contract.schemas import DeliveryList, DeliveryState
from service.webhooks.outbox import delivery_list

router = APIRouter(prefix="/v1/deliveries", tags=["webhooks"])


@router.get("", responses=problems(401, 403, 422, 429))
def list_deliveries(
    api: UseApi,
    caller: Reads,
    state: Annotated[
        DeliveryState, Query(description="select by this value; by default those that were given up")
    ] = DeliveryState.GIVEN_UP,
    limit: Annotated[int, Query(ge=1, le=1000, description="messages on a page")] = 50,
    cursor: Annotated[
        str | None, Query(pattern=MESSAGE_CURSOR, description="`id` of the last message of the page")
    ] = None,
) -> DeliveryList:
    """List messages to webhooks, newest first: by default those that no receiver accepted."""
    return delivery_list(api.deliveries.list_of(caller.tenant, state, cursor, limit))
