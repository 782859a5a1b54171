"""Parameters that several routes take."""

from typing import Annotated, Any

from fastapi import Header, Path, Query

from service.contract.model_base import CURSOR, VISIBLE_ASCII

JobId = Annotated[str, Path(description="`id` of the job", examples=["01a2019a-6685-7220-8c73-80d9802cf568"])]
Cursor = Annotated[str | None, Query(pattern=CURSOR, description="`next` of the previous page")]


def idempotency_header(effect: str) -> Any:
    """The header `Idempotency-Key`; `effect` is what sending it again does."""
    return Header(
        min_length=1,
        max_length=255,
        pattern=VISIBLE_ASCII,
        description=f"chosen by the client; {effect}",
    )
