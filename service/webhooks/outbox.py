"""Stored webhook messages and secrets, by Standard Webhooks (standardwebhooks.com).

`service.jobs.deliveries` stores a message when a job ends. It is sent until the receiver accepts it, or the
last attempt failed. A receiver may get a message twice, if a sender died after it sent it: both have the same
`webhook-id`.
"""

import secrets
from base64 import b64encode
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass

from sqlalchemy import BigInteger, Engine, String, func, select, update
from sqlalchemy.exc import IntegrityError
from sqlalchemy.orm import Mapped, mapped_column, sessionmaker

from service.contract.schemas import Delivery, DeliveryAttempt, DeliveryList, DeliveryState
from service.jobs.clock import clock_of
from service.jobs.deliveries import DeliveryRow
from service.jobs.models import Base
from service.jobs.views import time_of

#: Seconds from a failed attempt to the next, as Standard Webhooks recommends: about two days in all.
BACK_OFF_S = (5, 30, 120, 600, 1800, 3600, 3 * 3600, 6 * 3600, 12 * 3600, 24 * 3600)
LEASE_MS = 60_000  # another sender may take a message after this, since its sender may have died
GONE = 410  # HTTP status: the receiver wants no more messages
ROTATION_MS = 24 * 3_600_000  # messages are also signed with the old secret for this time


@dataclass(frozen=True, slots=True)
class Answer:
    """Result of an attempt. status : None if there was no answer; error : the reason"""

    status: int | None
    error: str | None
    seconds: float
    retry_after_s: int = 0
    is_forbidden: bool = False

    @property
    def is_accepted(self) -> bool:
        """True if the receiver answered 2xx."""
        return self.status is not None and 200 <= self.status < 300


class SecretRow(Base):
    """The secret that signs the messages of a tenant."""

    __tablename__ = "webhook_secrets"

    tenant: Mapped[str] = mapped_column(String(64), primary_key=True)
    secret: Mapped[str] = mapped_column(String(80))
    previous: Mapped[str | None] = mapped_column(String(80))
    created_ms: Mapped[int] = mapped_column(BigInteger)


def delivery_list(rows: Sequence[DeliveryRow]) -> DeliveryList:
    """The messages of a job as the API shows them."""
    return DeliveryList(deliveries=[delivery_of(row) for row in rows])


def delivery_of(row: DeliveryRow) -> Delivery:
    """A message as the API shows it."""
    attempts = [
        DeliveryAttempt(
            at=time_of(attempt["at_ms"]),
            status=attempt["status"],
            error=attempt["error"],
            seconds=attempt["seconds"],
        )
        for attempt in row.attempts
    ]
    is_waiting = row.state == DeliveryState.WAITING
    return Delivery(
        id=row.id,
        job=row.job_id,
        event=row.event,
        url=row.url,
        state=DeliveryState(row.state),
        next=time_of(row.next_ms) if is_waiting else None,
        attempts=attempts,
    )


class Deliveries:
    """The messages and secrets of one database. Safe to share between threads."""

    def __init__(self, engine: Engine, clock_ms: Callable[[], int] | None = None) -> None:
        self._session = sessionmaker(engine, expire_on_commit=False)
        self._clock_ms = clock_ms or clock_of(engine)

    def of_job(self, job_id: str) -> Sequence[DeliveryRow]:
        """A job's messages, oldest first."""
        with self._session() as session:
            query = select(DeliveryRow).where(DeliveryRow.job_id == job_id).order_by(DeliveryRow.id)
            return session.scalars(query).all()

    def take(
        self,
        limit: int,
        *,
        without: Sequence[str] = (),
        room: Callable[[str], int] | None = None,
        tenant_room: Callable[[str], int] | None = None,
    ) -> list[DeliveryRow]:
        """Up to `limit` messages that are due; no other sender gets them for `LEASE_MS`.

        Tenants take turns, and so do the receivers of each: the oldest message of each comes first, then the
        second of each. One name has any number of receivers, so their turns alone would help nobody.
        without : receivers that get nothing now; room, tenant_room : how many messages a receiver, and all
        receivers of a tenant, may get, None: any
        """
        now = self._clock_ms()
        turn = func.row_number().over(
            partition_by=(DeliveryRow.tenant, DeliveryRow.receiver),
            order_by=(DeliveryRow.next_ms, DeliveryRow.id),
        )
        columns = (DeliveryRow.id, DeliveryRow.tenant, DeliveryRow.receiver, DeliveryRow.next_ms)
        due = (
            select(*columns, turn.label("turn"))
            .where(
                DeliveryRow.state == DeliveryState.WAITING,
                DeliveryRow.next_ms <= now,
                DeliveryRow.receiver.not_in(without),
            )
            .subquery()
        )
        of_tenant = func.row_number().over(
            partition_by=due.c.tenant, order_by=(due.c.turn, due.c.next_ms, due.c.id)
        )
        ranked = select(due, of_tenant.label("of_tenant")).subquery()
        candidates = select(ranked.c.id, ranked.c.tenant, ranked.c.receiver).order_by(
            ranked.c.of_tenant, ranked.c.turn, ranked.c.next_ms, ranked.c.id
        )
        taken: list[DeliveryRow] = []
        with self._session.begin() as session:
            for each, tenant, receiver in session.execute(candidates.limit(limit)).all():
                if room is not None and sum(row.receiver == receiver for row in taken) >= room(receiver):
                    continue
                of_tenant_taken = sum(row.tenant == tenant for row in taken)
                if tenant_room is not None and of_tenant_taken >= tenant_room(tenant):
                    continue
                mine = (
                    update(DeliveryRow)
                    .where(DeliveryRow.id == each, DeliveryRow.next_ms <= now)
                    .values(next_ms=now + LEASE_MS)
                    .returning(DeliveryRow)
                )
                taken += session.scalars(mine, execution_options={"synchronize_session": False}).all()
        return taken

    def list_of(
        self, tenant: str, state: DeliveryState, before_id: str | None, limit: int
    ) -> Sequence[DeliveryRow]:
        """Messages of a tenant in this state, newest first."""
        query = select(DeliveryRow).where(DeliveryRow.tenant == tenant, DeliveryRow.state == state)
        if before_id is not None:
            query = query.where(DeliveryRow.id < before_id)
        with self._session() as session:
            return session.scalars(query.order_by(DeliveryRow.id.desc()).limit(limit)).all()

    def redeliver(self, job_id: str, message_id: str) -> DeliveryRow | None:
        """Send a message again, as if for the first time; None if the job has no such message.

        One that waits is sent at once, with the attempts that it has left.
        """
        now = self._clock_ms()
        mine = (DeliveryRow.id == message_id, DeliveryRow.job_id == job_id)
        with self._session.begin() as session:
            session.execute(
                update(DeliveryRow)
                .where(*mine, DeliveryRow.state != DeliveryState.WAITING)
                .values(state=DeliveryState.WAITING, attempts=[])
            )
            done = session.scalars(
                update(DeliveryRow).where(*mine).values(next_ms=now).returning(DeliveryRow),
                execution_options={"synchronize_session": False},
            )
            return done.one_or_none()

    def note(self, row: DeliveryRow, answer: Answer) -> DeliveryState:
        """Store the result of an attempt, and the time of the next one."""
        now = self._clock_ms()
        attempt = {
            "at_ms": now,
            "status": answer.status,
            "error": answer.error,
            "seconds": round(answer.seconds, 3),
        }
        attempts = [*row.attempts, attempt]
        state, next_ms = DeliveryState.WAITING, now
        if answer.is_accepted:
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
        """The valid secrets of a tenant, newest first; the first call creates one."""
        with (
            suppress(IntegrityError),
            self._session.begin() as session,
        ):  # two calls at once: the first one wins
            if session.get(SecretRow, tenant) is None:
                session.add(
                    SecretRow(tenant=tenant, secret=_new_secret(), previous=None, created_ms=self._clock_ms())
                )
        with self._session() as session:
            row = session.get_one(SecretRow, tenant)
            is_recent = self._clock_ms() - row.created_ms < ROTATION_MS
            return [row.secret, *([row.previous] if row.previous and is_recent else [])]

    def rotate(self, tenant: str) -> str:
        """Create a new secret. For a day messages are signed with the old one too."""
        old = self.secrets(tenant)[0]
        with self._session.begin() as session:
            row = session.get_one(SecretRow, tenant)
            row.secret, row.previous, row.created_ms = _new_secret(), old, self._clock_ms()
            return row.secret


def _new_secret() -> str:
    return "whsec_" + b64encode(secrets.token_bytes(32)).decode()
