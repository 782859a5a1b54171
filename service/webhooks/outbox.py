"""Webhooks by Standard Webhooks (standardwebhooks.com): a job that is final is told to the address that came with it.

A message is stored in the same transaction as the job's end, so none is lost, and sent until it was taken or given up. A
receiver may get a message twice (a sender died after sending): `webhook-id` is the same then.
"""

import secrets
from base64 import b64encode
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass

from sqlalchemy import BigInteger, Engine, String, select, update
from sqlalchemy.exc import IntegrityError
from sqlalchemy.orm import Mapped, mapped_column, sessionmaker

from service.contract.schemas import Delivery, DeliveryAttempt, DeliveryList, DeliveryState
from service.jobs.deliveries import DeliveryRow
from service.jobs.models import Base, now_ms
from service.jobs.views import time_of

#: Seconds from a failed attempt to the next: as Standard Webhooks advises, some two days in all.
BACK_OFF_S = (5, 30, 120, 600, 1800, 3600, 3 * 3600, 6 * 3600, 12 * 3600, 24 * 3600)
LEASE_MS = 60_000  # a sender that took a message and died: another may send it after this
GONE = 410  # the receiver wants no more of it
ROTATION_MS = 24 * 3_600_000  # so long messages are signed with the old secret too


@dataclass(frozen=True, slots=True)
class Answer:
    """How an attempt ended. status : None when no answer came; error : why"""

    status: int | None
    error: str | None
    seconds: float
    retry_after_s: int = 0
    is_forbidden: bool = False

    @property
    def is_taken(self) -> bool:
        """True when the receiver said 2xx."""
        return self.status is not None and 200 <= self.status < 300


class SecretRow(Base):
    """What a tenant's messages are signed with."""

    __tablename__ = "webhook_secrets"

    tenant: Mapped[str] = mapped_column(String(64), primary_key=True)
    secret: Mapped[str] = mapped_column(String(80))
    previous: Mapped[str | None] = mapped_column(String(80))
    created_ms: Mapped[int] = mapped_column(BigInteger)


def delivery_list(rows: Sequence[DeliveryRow]) -> DeliveryList:
    """What clients see of a job's messages."""
    told = []
    for row in rows:
        attempts = [
            DeliveryAttempt(
                at=time_of(tried["at_ms"]),
                status=tried["status"],
                error=tried["error"],
                seconds=tried["seconds"],
            )
            for tried in row.attempts
        ]
        is_waiting = row.state == DeliveryState.WAITING
        told.append(
            Delivery(
                id=row.id,
                event=row.event,
                url=row.url,
                state=DeliveryState(row.state),
                next=time_of(row.next_ms) if is_waiting else None,
                attempts=attempts,
            )
        )
    return DeliveryList(deliveries=told)


class Deliveries:
    """The messages and secrets of one database. Safe to share between threads."""

    def __init__(self, engine: Engine, clock_ms: Callable[[], int] = now_ms) -> None:
        self._session = sessionmaker(engine, expire_on_commit=False)
        self._clock_ms = clock_ms

    def of_job(self, job_id: str) -> Sequence[DeliveryRow]:
        """A job's messages, oldest first."""
        with self._session() as session:
            query = select(DeliveryRow).where(DeliveryRow.job_id == job_id).order_by(DeliveryRow.id)
            return session.scalars(query).all()

    def take(self, limit: int) -> list[DeliveryRow]:
        """Up to `limit` messages that are due; for `LEASE_MS` nobody else gets them."""
        now = self._clock_ms()
        due = select(DeliveryRow.id).where(
            DeliveryRow.state == DeliveryState.WAITING, DeliveryRow.next_ms <= now
        )
        taken: list[DeliveryRow] = []
        with self._session.begin() as session:
            for each in session.scalars(due.order_by(DeliveryRow.next_ms, DeliveryRow.id).limit(limit)).all():
                mine = (
                    update(DeliveryRow)
                    .where(DeliveryRow.id == each, DeliveryRow.next_ms <= now)
                    .values(next_ms=now + LEASE_MS)
                    .returning(DeliveryRow)
                )
                taken += session.scalars(mine, execution_options={"synchronize_session": False}).all()
        return taken

    def note(self, row: DeliveryRow, answer: Answer) -> DeliveryState:
        """Write down how an attempt ended, and when the next one is."""
        now = self._clock_ms()
        tried = {
            "at_ms": now,
            "status": answer.status,
            "error": answer.error,
            "seconds": round(answer.seconds, 3),
        }
        attempts = [*row.attempts, tried]
        state, next_ms = DeliveryState.WAITING, now
        if answer.is_taken:
            state = DeliveryState.DELIVERED
        elif answer.status == GONE or answer.is_forbidden or len(attempts) > len(BACK_OFF_S):
            state = DeliveryState.GIVEN_UP
        else:
            wait_s = max(BACK_OFF_S[len(attempts) - 1], answer.retry_after_s)
            next_ms = now + 1000 * wait_s
        with self._session.begin() as session:
            session.execute(
                update(DeliveryRow)
                .where(DeliveryRow.id == row.id, DeliveryRow.state == DeliveryState.WAITING)
                .values(attempts=attempts, state=state, next_ms=next_ms)
            )
        return state

    def secrets(self, tenant: str) -> list[str]:
        """What the tenant's messages are signed with now, the newest first; made at the first call."""
        with suppress(IntegrityError), self._session.begin() as session:  # two at once: the first one's stays
            if session.get(SecretRow, tenant) is None:
                session.add(
                    SecretRow(tenant=tenant, secret=_new_secret(), previous=None, created_ms=self._clock_ms())
                )
        with self._session() as session:
            row = session.get_one(SecretRow, tenant)
            is_recent = self._clock_ms() - row.created_ms < ROTATION_MS
            return [row.secret, *([row.previous] if row.previous and is_recent else [])]

    def rotate(self, tenant: str) -> str:
        """A new secret; for a day messages are signed with the old one too."""
        old = self.secrets(tenant)[0]
        with self._session.begin() as session:
            row = session.get_one(SecretRow, tenant)
            row.secret, row.previous, row.created_ms = _new_secret(), old, self._clock_ms()
            return row.secret


def _new_secret() -> str:
    return "whsec_" + b64encode(secrets.token_bytes(32)).decode()
