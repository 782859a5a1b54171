"""The rows of worker processes: one that lives writes a heartbeat every second."""

from sqlalchemy import delete, select

from service.jobs.models import WorkerRow
from service.jobs.table_access import TableAccess


class WorkerRegistry(TableAccess):
    """Heartbeats of the workers of one database."""

    def worker_beat(self, worker: str) -> None:
        """Write a heartbeat."""
        with self._session.begin() as session:
            session.merge(WorkerRow(id=worker, heartbeat_ms=self._clock_ms()))

    def worker_gone(self, worker: str) -> None:
        """Delete the row of a worker that stops."""
        with self._session.begin() as session:
            session.execute(delete(WorkerRow).where(WorkerRow.id == worker))

    def worker_heard_ms(self, worker: str) -> int | None:
        """Time of the last heartbeat; None if the worker never ran, or stopped."""
        with self._session() as session:
            return session.scalar(select(WorkerRow.heartbeat_ms).where(WorkerRow.id == worker))

    def live_workers(self, within_ms: int) -> set[str]:
        """Names of the workers with a heartbeat within the last `within_ms`."""
        query = select(WorkerRow.id).where(WorkerRow.heartbeat_ms >= self._clock_ms() - within_ms)
        with self._session() as session:
            return set(session.scalars(query))

    def has_worker(self, within_ms: int) -> bool:
        """True if any worker had a heartbeat within the last `within_ms`."""
        query = select(WorkerRow.id).where(WorkerRow.heartbeat_ms >= self._clock_ms() - within_ms).limit(1)
        with self._session() as session:
            return session.scalar(query) is not None
