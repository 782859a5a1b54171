"""Recovers lost jobs: those that wait without a usable queue entry, and those whose worker is dead."""

from collections.abc import Callable

import structlog

from service.contract.errors import JobCrashed, problem_of
from service.contract.schemas import Status
from service.jobs.liveness import DEAD_AFTER_MS
from service.jobs.models import MAX_CRASHES, JobRow
from service.jobs.queue import Queue
from service.jobs.store import JobStore
from service.storage.retry import DATABASE_UNAVAILABLE

LOST_AFTER_MS = 3_000  # the dispatcher adds an entry within milliseconds
log = structlog.get_logger()


class Reaper:
    """Call `at_start` before the worker takes entries, and `sweep` every few seconds after."""

    def __init__(self, jobs: JobStore, queue: Queue, *, clock_may_jump: bool = False) -> None:
        """clock_may_jump : the clock of the jobs is that of this machine, which can be set: then a worker is
        dead only when a second sweep finds no newer heartbeat
        """
        self._jobs, self._queue, self._clock_may_jump = jobs, queue, clock_may_jump
        self._silent: dict[str, int | None] = {}  # heartbeats of jobs that the last sweep found silent

    def at_start(self, worker_id: str) -> None:
        """Reassign what this worker ran when it died; DBOS recovers the queue entries at its launch."""
        for job_id in self._jobs.orphans(worker=worker_id):
            self._reassign(job_id, lambda row: row.worker == worker_id)

    def sweep(self) -> None:
        """One pass over all running and waiting jobs."""
        since_ms = self._jobs.now_ms() - DEAD_AFTER_MS
        before, self._silent = self._silent, {}

        def is_lost(row: JobRow) -> bool:
            if (row.heartbeat_ms or 0) >= since_ms:
                return False
            self._silent[row.id] = row.heartbeat_ms
            return not self._clock_may_jump or before.get(row.id, -1) == row.heartbeat_ms

        for job_id in self._jobs.orphans(silent_since_ms=since_ms):
            if (lost := self._reassign(job_id, is_lost)) is not None:
                self._requeue(lost.id, lost.rank)
        waiting = self._jobs.waiting_since(self._jobs.now_ms() - LOST_AFTER_MS)
        if not waiting:
            return
        entries, alive = self._queue.entries(), self._jobs.live_workers(DEAD_AFTER_MS)
        for job_id, rank in waiting.items():
            holder = entries.get(job_id, "nobody")
            if holder is not None and holder not in alive:
                log.warning(
                    "job had no queue entry that a live worker would take", job_id=job_id, holder=holder
                )
                self._requeue(job_id, rank)

    def _requeue(self, job_id: str, rank: int) -> None:
        """A job that cannot be queued now waits for the next sweep; the others go on."""
        try:
            self._queue.requeue(job_id, rank)
        except DATABASE_UNAVAILABLE:
            raise
        except Exception:
            log.exception("job not queued", job_id=job_id)

    def _reassign(self, job_id: str, is_lost: Callable[[JobRow], bool]) -> JobRow | None:
        """The job if it waits again. A row that cannot be read stays as it is and is logged."""
        try:
            row = self._jobs.find(job_id)
            if row is None or not is_lost(row):  # another worker was faster, and runs it
                return None
            problem = problem_of(
                JobCrashed(f"{MAX_CRASHES} workers died while they ran this job; report it with the job's id")
            )
            status = self._jobs.reassign(row, problem)
        except DATABASE_UNAVAILABLE:
            raise
        except Exception:
            log.exception("a job's row cannot be read; repair it in the database", job_id=job_id)
            return None
        log.warning(
            "worker of the job died", job_id=row.id, attempt=row.attempt, worker=row.worker, status=status
        )
        return row if status is Status.ACCEPTED else None
