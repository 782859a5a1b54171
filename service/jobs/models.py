"""A job as a row, and the transitions its status may make. This table decides; the queue only orders what
runs next.
"""

from datetime import UTC, datetime
from typing import Any

import uuid_utils
from sqlalchemy import JSON, BigInteger, Enum, Float, Index, String, Text
from sqlalchemy.orm import DeclarativeBase, Mapped, mapped_column

from service.contract.schemas import Status
from service.jobs.names import names_of_new_row

DEFAULT_TENANT = "default"  # of a service without keys
MAX_CRASHES = 3  # after so many dead workers the job itself is taken for the cause

#: Which status may follow which. RUNNING -> ACCEPTED: its worker died or stopped.
MOVES: dict[Status, frozenset[Status]] = {
    Status.ACCEPTED: frozenset({Status.RUNNING, Status.FAILED, Status.DISMISSED}),
    Status.RUNNING: frozenset({Status.ACCEPTED, Status.SUCCESSFUL, Status.FAILED, Status.DISMISSED}),
    Status.SUCCESSFUL: frozenset(),
    Status.FAILED: frozenset(),
    Status.DISMISSED: frozenset(),
}


class IllegalMove(Exception):
    """A status transition that MOVES does not allow."""


def check_move(before: Status, after: Status) -> None:
    """Raise IllegalMove unless `after` may follow `before`."""
    if after not in MOVES[before]:
        raise IllegalMove(f"a job cannot go from {before} to {after}")


# The words themselves as text, so that a person can read the table and a later version can add one.
_STATUS = Enum(
    Status, native_enum=False, create_constraint=False, length=16, values_callable=lambda words: list(words)
)


class Base(DeclarativeBase):
    """Base of the tables that Alembic migrates."""


class JobRow(Base):
    """Times are milliseconds since 1970 (UTC): SQLite and PostgreSQL compare and sort them alike."""

    __tablename__ = "jobs"
    __table_args__ = (
        Index("jobs_by_status", "status", "id"),
        Index("jobs_by_turn", "status", "turn"),
        Index("jobs_by_ticket", "has_ticket", "status", "turn"),
        Index("jobs_by_tenant_turn", "tenant", "status", "turn"),
        Index("jobs_by_label", "label", "id"),
        Index("jobs_by_tenant", "tenant", "id"),
        Index("jobs_by_verdict", "tenant", "verdict", "id"),
        Index("jobs_by_decision", "tenant", "decision", "id"),
        Index("jobs_by_serial", "tenant", "serial", "id"),
        Index("jobs_by_batch", "tenant", "batch", "id"),
        Index("jobs_by_part_number", "tenant", "part_number", "id"),
        Index("jobs_by_outcome", "tenant", "verdict", "decision", "id"),
        Index("jobs_by_batch_id", "batch_id", "batch_index"),
        Index("jobs_by_names", "tenant", "id", "names"),
    )

    id: Mapped[str] = mapped_column(String(36), primary_key=True)
    tenant: Mapped[str] = mapped_column(String(64), default=DEFAULT_TENANT)
    type: Mapped[str] = mapped_column(String(32))
    status: Mapped[Status] = mapped_column(_STATUS)
    stage: Mapped[str | None] = mapped_column(String(32))
    progress: Mapped[float] = mapped_column(Float, default=0.0)
    message: Mapped[str | None] = mapped_column(String(500))
    label: Mapped[str | None] = mapped_column(String(200))
    inputs: Mapped[dict[str, Any]] = mapped_column(JSON)  # mesh name -> {"blob", "filename"}
    options: Mapped[dict[str, Any]] = mapped_column(JSON)  # schemas.Options
    attempt: Mapped[int] = mapped_column(default=0)
    rank: Mapped[int] = mapped_column("turn", default=0)  # fair-queue rank, lowest first; see queue_entries
    is_enqueued: Mapped[bool] = mapped_column("has_ticket", default=False)  # see Dispatcher
    crashes: Mapped[int] = mapped_column(default=0)  # attempts that ended with the worker's death
    worker: Mapped[str | None] = mapped_column(String(100))
    heartbeat_ms: Mapped[int | None] = mapped_column(BigInteger)
    created_ms: Mapped[int] = mapped_column(BigInteger)
    started_ms: Mapped[int | None] = mapped_column(BigInteger)
    finished_ms: Mapped[int | None] = mapped_column(BigInteger)
    error: Mapped[dict[str, Any] | None] = mapped_column(JSON)  # schemas.Problem
    verdict: Mapped[str | None] = mapped_column(String(32))  # of the published results
    decision: Mapped[str | None] = mapped_column(String(16))  # of the same
    within: Mapped[float | None] = mapped_column(Float)  # of the same: share of the area within the tolerance
    serial: Mapped[str | None] = mapped_column(String(100))  # these three: of options.reference
    batch: Mapped[str | None] = mapped_column(String(100))
    part_number: Mapped[str | None] = mapped_column(String(100))
    names: Mapped[str | None] = mapped_column(Text, default=names_of_new_row)  # searched for parts of them
    batch_id: Mapped[str | None] = mapped_column(String(36))  # of a BatchRow
    batch_index: Mapped[int | None]  # place of the scan in the batch
    files: Mapped[list[dict[str, Any]] | None] = mapped_column(JSON)  # of the published attempt
    published_attempt: Mapped[int | None]
    result_bytes: Mapped[int] = mapped_column(BigInteger, default=0)  # of `files`
    removed_ms: Mapped[int | None] = mapped_column(BigInteger)  # set: hidden from clients, the id is kept


class BlobRow(Base):
    """An uploaded mesh, identified by its content; one row for each tenant that sent it."""

    __tablename__ = "blobs"

    tenant: Mapped[str] = mapped_column(String(64), primary_key=True)
    id: Mapped[str] = mapped_column(String(71), primary_key=True)  # sha256:<hex>
    size: Mapped[int] = mapped_column(BigInteger)
    format: Mapped[str] = mapped_column(String(8))
    created_ms: Mapped[int] = mapped_column(BigInteger)


class IdempotencyRow(Base):
    """The job behind a client's `Idempotency-Key`. request_sha256 : of the content of the inputs and the
    options
    """

    __tablename__ = "idempotency_keys"

    tenant: Mapped[str] = mapped_column(String(64), primary_key=True)
    key: Mapped[str] = mapped_column(String(255), primary_key=True)
    request_sha256: Mapped[str] = mapped_column(String(64))
    job_id: Mapped[str] = mapped_column(String(36))
    created_ms: Mapped[int] = mapped_column(BigInteger)


class WorkerRow(Base):
    """A worker process that was alive at `heartbeat_ms`."""

    __tablename__ = "workers"

    id: Mapped[str] = mapped_column(String(100), primary_key=True)
    heartbeat_ms: Mapped[int] = mapped_column(BigInteger)


def new_id() -> str:
    """A UUIDv7: ids of one process sort by time, also within one millisecond."""
    return str(uuid_utils.uuid7())


def made_ms(job_id: str) -> int | None:
    """Time encoded in an id, ms since 1970; None if it is no UUIDv7 of ours."""
    try:
        return uuid_utils.UUID(job_id).timestamp
    except ValueError:
        return None


def now_ms() -> int:
    """The current time in the unit of the tables: ms since 1970 (UTC)."""
    return int(datetime.now(UTC).timestamp() * 1000)
