"""The webhook message of a job that became final. It is stored in the transaction that ends the job, so none
is lost.

`service.webhooks` sends it.
"""

import json
from datetime import UTC, datetime
from typing import Any
from urllib.parse import urlsplit

import structlog
from sqlalchemy import JSON, BigInteger, Index, String, Text
from sqlalchemy.exc import DBAPIError
from sqlalchemy.orm import Mapped, Session, mapped_column

from service.contract.schemas import DeliveryState
from service.jobs.models import Base, JobRow, new_id
from service.jobs.views import job_of

MAX_RECEIVER = 300  # characters
log = structlog.get_logger()


def receiver_of(url: str) -> str:
    """`scheme://host:port`: what fails or is slow as a whole."""
    try:
        parts = urlsplit(url)
        return f"{parts.scheme}://{parts.netloc.rpartition('@')[2]}".lower()[:MAX_RECEIVER]
    except ValueError:
        return url[:MAX_RECEIVER]


class DeliveryRow(Base):
    """A message: its content, its receiver and the result of each attempt. id : the header `webhook-id`"""

    __tablename__ = "deliveries"
    __table_args__ = (
        Index("deliveries_due", "state", "next_ms"),
        Index("deliveries_by_job", "job_id", "id"),
        Index("deliveries_by_tenant", "tenant", "state", "id"),
    )

    id: Mapped[str] = mapped_column(String(40), primary_key=True)
    job_id: Mapped[str] = mapped_column(String(36))
    tenant: Mapped[str] = mapped_column(String(64))
    url: Mapped[str] = mapped_column(String(2000))
    receiver: Mapped[str] = mapped_column(String(MAX_RECEIVER), default="")
    event: Mapped[str] = mapped_column(String(32))
    body: Mapped[str] = mapped_column(Text)
    state: Mapped[str] = mapped_column(String(16))  # schemas.DeliveryState
    next_ms: Mapped[int] = mapped_column(BigInteger)
    created_ms: Mapped[int] = mapped_column(BigInteger)
    attempts: Mapped[list[dict[str, Any]]] = mapped_column(JSON)


def announce(session: Session, job_id: str, at_ms: int) -> None:
    """Store the message of a job that ends, if its client asked for one. Call it in the transaction that ends
    the job.

    A row that cannot be read (damaged, or written by a later version) still ends; no message is sent for it.
    """
    try:
        message = _message(session.get_one(JobRow, job_id), at_ms)
    except DBAPIError:
        raise  # the transaction is void and must not look committed
    except Exception:
        log.exception("no webhook message stored: the row of the job cannot be read", job_id=job_id)
        return
    if message is not None:
        session.add(message)


def _message(row: JobRow, at_ms: int) -> DeliveryRow | None:
    webhook = row.options.get("webhook")
    if webhook is None:
        return None
    event = f"job.{row.status.value}"
    payload = {
        "type": event,
        "timestamp": datetime.fromtimestamp(at_ms / 1000, UTC).isoformat().replace("+00:00", "Z"),
        "data": job_of(row).model_dump(mode="json"),
    }
    return DeliveryRow(
        id=f"msg_{new_id()}",
        job_id=row.id,
        tenant=row.tenant,
        url=webhook["url"],
        receiver=receiver_of(webhook["url"]),
        event=event,
        body=json.dumps(payload, ensure_ascii=False, separators=(",", ":")),
        state=DeliveryState.WAITING,
        next_ms=at_ms,
        created_ms=at_ms,
        attempts=[],
    )
