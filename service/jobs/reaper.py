"""Finds the jobs that fell between the chairs: waiting without a ticket, or running on a worker that is dead."""

from collections.abc import Callable

import structlog

from service.contract.errors import JobCrashed, problem_of
from service.contract.schemas import Status
from service.jobs.liveness import DEAD_AFTER_MS
from service.jobs.models import MAX_CRASHES, JobRow, now_ms
from service.jobs.queue import Queue
from service.jobs.store import JobStore
from service.storage.retry import DATABASE_UNAVAILABLE

LOST_AFTER_MS = 3_000  # the desk gives a job its ticket within milliseconds
log = structlog.get_logger()


class Reaper:
    """Call `at_start` before the worker takes tickets, and `sweep` every few seconds after."""

    def __init__(self, jobs: JobStore, queue: Queue) -> None:
        self._jobs, self._queue = jobs, queue

    def at_start(self, worker_id: str) -> None:
        """What this worker ran when it died waits again; DBOS brings the tickets back at its launch."""
        for job_id in self._jobs.orphans(worker=worker_id):
            self._hand_on(job_id, lambda row: row.worker == worker_id)

    def sweep(self) -> None:
        """Once over everything."""
        since_ms = now_ms() - DEAD_AFTER_MS
        for job_id in self._jobs.orphans(silent_since_ms=since_ms):
            if (row := self._hand_on(job_id, lambda row: (row.heartbeat_ms or 0) < since_ms)) is not None:
                self._requeue(row.id, row.turn)
        waiting = self._jobs.waiting_since(now_ms() - LOST_AFTER_MS)
        if not waiting:
            return
        tickets, alive = self._queue.tickets(), self._jobs.live_workers(DEAD_AFTER_MS)
        for job_id, turn in waiting.items():
            holder = tickets.get(job_id, "nobody")
            if holder is not None and holder not in alive:
                log.warning("job had no ticket that anybody would take", job_id=job_id, holder=holder)
                self._requeue(job_id, turn)

    def _requeue(self, job_id: str, turn: int) -> None:
        """One that cannot be queued now waits for the next sweep, and holds up no other."""
        try:
            self._queue.requeue(job_id, turn)
        except DATABASE_UNAVAILABLE:
            raise
        except Exception:
            log.exception("job not queued", job_id=job_id)

    def _hand_on(self, job_id: str, is_lost: Callable[[JobRow], bool]) -> JobRow | None:
        """The job, when it waits again. One whose row cannot be read stays as it is, and whoever reads the log is told."""
        try:
            row = self._jobs.find(job_id)
            if row is None or not is_lost(row):  # another worker was faster, and runs it
                return None
            problem = problem_of(
                JobCrashed(f"{MAX_CRASHES} workers died while they ran this job; report it with the job's id")
            )
            status = self._jobs.hand_on(row, problem)
        except DATABASE_UNAVAILABLE:
            raise
        except Exception:
            log.exception("a job's row cannot be read; see to it in the database", job_id=job_id)
            return None
        log.warning("its worker died", job_id=row.id, attempt=row.attempt, worker=row.worker, status=status)
        return row if status is Status.ACCEPTED else None
