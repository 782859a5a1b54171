"""Which jobs have a queue entry, and in which order jobs run: their fair-queue rank."""

from collections.abc import Sequence

from sqlalchemy import func, select, update
from sqlalchemy.orm import Session

from service.contract.schemas import Status
from service.jobs.models import JobRow
from service.jobs.table_access import TableAccess


class QueueEntries(TableAccess):
    """Accepted jobs and their entries in the queue."""

    def waiting_since(self, before_ms: int) -> dict[str, int]:
        """Accepted jobs with a queue entry that were created before `before_ms`: id -> rank, oldest first."""
        waits = (
            JobRow.status == Status.ACCEPTED,
            JobRow.is_enqueued.is_(True),
            JobRow.created_ms < before_ms,
        )
        query = select(JobRow.id, JobRow.rank).where(*waits)
        with self._session() as session:
            return {row.id: row.rank for row in session.execute(query.order_by(JobRow.id))}

    def without_queue_entry(self, limit: int) -> dict[str, int]:
        """Accepted jobs that have no queue entry yet: id -> rank, lowest rank first."""
        query = select(JobRow.id, JobRow.rank).where(
            JobRow.is_enqueued.is_(False), JobRow.status == Status.ACCEPTED
        )
        with self._session() as session:
            return {
                row.id: row.rank
                for row in session.execute(query.order_by(JobRow.rank, JobRow.id).limit(limit))
            }

    def dismissed_with_queue_entry(self, limit: int) -> Sequence[str]:
        """Dismissed jobs that still have a queue entry."""
        query = select(JobRow.id).where(JobRow.is_enqueued.is_(True), JobRow.status == Status.DISMISSED)
        with self._session() as session:
            return session.scalars(query.limit(limit)).all()

    def note_queue_entry(self, job_ids: Sequence[str], *, is_enqueued: bool) -> None:
        """Store whether the jobs have a queue entry."""
        with self._session.begin() as session:
            session.execute(
                update(JobRow).where(JobRow.id.in_(job_ids)).values(is_enqueued=is_enqueued),
                execution_options={"synchronize_session": False},
            )


def next_rank(session: Session, tenant: str) -> int:
    """Rank of a tenant's next job, by start-time fair queueing (Goyal et al. 1996) with a cost of 1 for each
    job.

    It comes after the tenant's last waiting job, but not before what runs now. Tenants with waiting jobs
    alternate, however many jobs each of them has.
    """
    waiting = JobRow.status == Status.ACCEPTED
    lowest = session.scalar(select(func.min(JobRow.rank)).where(waiting))
    if lowest is not None:
        now = lowest - 1
    else:
        now = session.scalar(select(func.max(JobRow.rank)).where(JobRow.status == Status.RUNNING)) or 0
    last = session.scalar(select(func.max(JobRow.rank)).where(waiting, JobRow.tenant == tenant)) or 0
    return max(now, last) + 1
