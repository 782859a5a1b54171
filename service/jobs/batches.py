"""Batches: many jobs on one design, with one status and one message at the end."""

import json
from collections.abc import Sequence
from datetime import UTC, datetime

from sqlalchemy import BigInteger, Index, Select, String, func, select, update
from sqlalchemy.exc import IntegrityError
from sqlalchemy.orm import Mapped, Session, mapped_column

from service.contract.schemas import Batch, BatchLinks, DeliveryState, Status
from service.jobs.admission import QueueLimits, begin_admission, end_admission
from service.jobs.deliveries import DeliveryRow, receiver_of
from service.jobs.metrics import count
from service.jobs.models import Base, IdempotencyRow, JobRow, new_id
from service.jobs.queue_entries import next_rank
from service.jobs.table_access import TableAccess
from service.jobs.views import time_of

FINISHED = "batch.finished"
_FAILED = (JobRow.status == Status.FAILED, JobRow.removed_ms.is_(None))


class BatchRow(Base):
    """unfinished : jobs that are not final; it is counted down in the transaction that ends a job, so that
    exactly one of them sends the message
    """

    __tablename__ = "batches"
    __table_args__ = (Index("batches_by_tenant", "tenant", "id"),)

    id: Mapped[str] = mapped_column(String(36), primary_key=True)
    tenant: Mapped[str] = mapped_column(String(64))
    label: Mapped[str | None] = mapped_column(String(200))
    webhook_url: Mapped[str | None] = mapped_column(String(2000))
    total: Mapped[int]
    unfinished: Mapped[int]
    created_ms: Mapped[int] = mapped_column(BigInteger)
    finished_ms: Mapped[int | None] = mapped_column(BigInteger)


class BatchRecords(TableAccess):
    """Batches and their jobs."""

    def add_batch(
        self,
        batch: BatchRow,
        jobs: Sequence[JobRow],
        key: str | None,
        request_sha256: str,
        limits: QueueLimits | None = None,
    ) -> BatchRow | None:
        """Store a batch with its jobs, all or none. Raises as QueueLimits.check.

        Returns the existing batch if the client's idempotency key belongs to one; None if it belongs to
        another request.
        """
        now = self._clock_ms()
        batch.created_ms, batch.unfinished = now, len(jobs)
        try:
            with self._session.begin() as session:
                begin_admission(session)
                if key is not None:
                    session.add(
                        IdempotencyRow(
                            tenant=batch.tenant,
                            key=key,
                            request_sha256=request_sha256,
                            job_id=batch.id,
                            created_ms=now,
                        )
                    )
                    session.flush()  # the key first: of two requests at once the second fails here
                session.add(batch)
                _add_jobs(session, jobs, batch, now)
                end_admission(session, batch.tenant, limits)
        except IntegrityError:
            with self._session() as session:
                known = session.get_one(IdempotencyRow, (batch.tenant, key))
                same = known.request_sha256 == request_sha256
                return session.get(BatchRow, known.job_id) if same else None
        return batch

    def batch(self, batch_id: str, tenant: str) -> BatchRow | None:
        """The tenant's batch."""
        if "\0" in batch_id:
            return None
        with self._session() as session:
            row = session.get(BatchRow, batch_id)
        return row if row is not None and row.tenant == tenant else None

    def batches(
        self, tenant: str, label: str | None, before_id: str | None, limit: int
    ) -> tuple[Sequence[BatchRow], str | None]:
        """Up to `limit` batches older than `before_id`, newest first, and the next `before_id`."""
        query = select(BatchRow).where(BatchRow.tenant == tenant)
        if label is not None:
            query = query.where(BatchRow.label == label)
        if before_id is not None:
            query = query.where(BatchRow.id < before_id)
        with self._session() as session:
            rows = session.scalars(query.order_by(BatchRow.id.desc()).limit(limit + 1)).all()
        return rows[:limit], rows[limit - 1].id if len(rows) > limit else None

    def batch_document(self, row: BatchRow) -> Batch:
        """What clients see."""
        with self._session() as session:
            return _document(session, row)

    def jobs_of_batch(self, batch_id: str) -> Sequence[JobRow]:
        """In the order of the scans; removed jobs too."""
        with self._session() as session:
            return session.scalars(_jobs(batch_id)).all()

    def dismiss_batch(self, batch_id: str) -> int:
        """Dismiss every job that is not final, in one transaction; workers kill what runs. Returns how
        many.
        """
        now = self._clock_ms()
        waits = JobRow.status.in_([Status.ACCEPTED, Status.RUNNING])
        with self._session.begin() as session:
            ended = session.scalars(
                update(JobRow)
                .where(JobRow.batch_id == batch_id, waits)
                .values(status=Status.DISMISSED, finished_ms=now)
                .returning(JobRow.id),
                execution_options={"synchronize_session": False},
            ).all()
            if ended:
                count(session, "cusp_jobs_ended", Status.DISMISSED.value, len(ended))
                jobs_ended(session, batch_id, now, len(ended))
        return len(ended)

    def count_failed(self, batch_id: str) -> int:
        """Jobs that failed."""
        query = select(func.count()).where(JobRow.batch_id == batch_id, *_FAILED)
        with self._session() as session:
            return session.scalar(query) or 0

    def retry_failed(self, batch_id: str) -> int:
        """A new job in the place of each that failed, which leaves the batch. Returns their number."""
        with self._session.begin() as session:
            # first the row of the batch: of two retries at once the second then finds none that failed
            batch = session.scalars(
                update(BatchRow)
                .where(BatchRow.id == batch_id)
                .values(unfinished=BatchRow.unfinished)
                .returning(BatchRow)
            ).one()
            failed = session.scalars(_jobs(batch_id).where(*_FAILED)).all()
            again = [
                JobRow(
                    id=new_id(),
                    tenant=row.tenant,
                    type=row.type,
                    inputs=row.inputs,
                    options=row.options,
                    label=row.label,
                    serial=row.serial,
                    batch=row.batch,
                    part_number=row.part_number,
                    batch_index=row.batch_index,
                )
                for row in failed
            ]
            for row in failed:
                row.batch_id = None
            if again:
                batch.unfinished, batch.finished_ms = batch.unfinished + len(again), None
                _add_jobs(session, again, batch, self._clock_ms())
            return len(again)

    def fetched_design(self, batch_id: str, url: str) -> dict[str, str] | None:
        """The design, once another job of the batch has fetched it from the address."""
        query = select(JobRow.inputs).where(JobRow.batch_id == batch_id, JobRow.status != Status.ACCEPTED)
        with self._session() as session:
            for inputs in session.scalars(query.order_by(JobRow.batch_index).limit(100)):
                design: dict[str, str] = inputs.get("design", {})
                if design.get("blob") and design.get("url") == url:
                    return design
        return None


def jobs_ended(session: Session, batch_id: str, at_ms: int, jobs: int = 1) -> None:
    """Count down, in the transaction that ends them; the last ends the batch and stores its message."""
    batch = session.scalars(
        update(BatchRow)
        .where(BatchRow.id == batch_id)
        .values(unfinished=BatchRow.unfinished - jobs)
        .returning(BatchRow),
        execution_options={"populate_existing": True},
    ).one_or_none()
    if batch is None or batch.unfinished > 0:
        return
    batch.finished_ms = at_ms
    session.flush()
    if batch.webhook_url is None:
        return
    payload = {
        "type": FINISHED,
        "timestamp": datetime.fromtimestamp(at_ms / 1000, UTC).isoformat().replace("+00:00", "Z"),
        "data": _document(session, batch).model_dump(mode="json"),
    }
    session.add(
        DeliveryRow(
            id=f"msg_{new_id()}",
            job_id=batch.id,
            tenant=batch.tenant,
            url=batch.webhook_url,
            receiver=receiver_of(batch.webhook_url),
            event=FINISHED,
            body=json.dumps(payload, ensure_ascii=False, separators=(",", ":")),
            state=DeliveryState.WAITING,
            next_ms=at_ms,
            created_ms=at_ms,
            attempts=[],
        )
    )


def _add_jobs(session: Session, jobs: Sequence[JobRow], batch: BatchRow, now_ms: int) -> None:
    first = next_rank(session, batch.tenant)
    for number, row in enumerate(jobs):
        row.status, row.created_ms, row.batch_id, row.rank = Status.ACCEPTED, now_ms, batch.id, first + number
    session.add_all(jobs)


def _jobs(batch_id: str) -> Select[JobRow]:
    return select(JobRow).where(JobRow.batch_id == batch_id).order_by(JobRow.batch_index)


def _document(session: Session, row: BatchRow) -> Batch:
    counted = session.execute(
        select(JobRow.status, JobRow.verdict, JobRow.decision, func.count())
        .where(JobRow.batch_id == row.id)
        .group_by(JobRow.status, JobRow.verdict, JobRow.decision)
    ).all()

    def by(column: int) -> dict[str, int]:
        found: dict[str, int] = {}
        for each in counted:
            if each[column] is not None:
                found[str(each[column])] = found.get(str(each[column]), 0) + each[3]
        return dict(sorted(found.items()))

    by_status = by(0)
    has_begun = set(by_status) != {Status.ACCEPTED}
    address = f"/v1/batches/{row.id}"
    return Batch.model_validate(
        {
            "id": row.id,
            "label": row.label,
            "status": "finished" if row.finished_ms is not None else "running" if has_begun else "accepted",
            "total": row.total,
            "by_status": by_status,
            "by_verdict": by(1),
            "by_decision": by(2),
            "created": time_of(row.created_ms),
            "finished": time_of(row.finished_ms),
            "links": BatchLinks(
                self=address,
                jobs=f"/v1/jobs?batch_id={row.id}",
                table=f"{address}/table.csv",
                deliveries=f"{address}/deliveries",
            ),
        }
    )
