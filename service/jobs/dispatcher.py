"""Puts accepted jobs into the queue, and removes the entries of dismissed ones.

The API writes rows only: it needs no queue, so no job is refused when the queue is unavailable. Any number of
workers may dispatch at the same time, since a queue entry has the id of its job. SQLite tells of commits;
PostgreSQL is asked every 0.05 s.
"""

import threading

import structlog

from service.jobs.queue import Queue
from service.jobs.store import JobStore
from service.storage.commit_watch import CommitWatch

POLL_INTERVAL_S = 0.05
TOLD_INTERVAL_S = 0.01  # between two passes, however often there are commits
SAFETY_INTERVAL_S = 1.0  # between two passes without a commit
RETRY_AFTER_S = 1.0
BATCH = 100  # jobs per pass, so that no pass takes long
log = structlog.get_logger()


class Dispatcher:
    """Call `dispatch` often, or `run` in a thread."""

    def __init__(self, jobs: JobStore, queue: Queue, commits: CommitWatch | None = None) -> None:
        """commits : of the database, if it tells of them"""
        self._jobs, self._queue, self._commits = jobs, queue, commits

    def dispatch(self) -> None:
        """One pass: add entries for accepted jobs without one, remove those of dismissed jobs."""
        for job_id, rank in self._jobs.without_queue_entry(BATCH).items():
            self._queue.enqueue(job_id, rank)
            self._jobs.note_queue_entry([job_id], is_enqueued=True)
        if dismissed := self._jobs.dismissed_with_queue_entry(BATCH):
            self._queue.drop(dismissed)
            self._jobs.note_queue_entry(dismissed, is_enqueued=False)

    def run(self, stop: threading.Event) -> None:
        """Dispatch until `stop` is set."""
        while not stop.wait(POLL_INTERVAL_S if self._commits is None else TOLD_INTERVAL_S):
            try:
                self.dispatch()
            except Exception:
                log.exception("jobs not dispatched")  # most likely the database is unavailable
                stop.wait(RETRY_AFTER_S)
                continue
            self._pause()

    def _pause(self) -> None:
        """Until the next commit, which may have come during the pass; without a watch not at all."""
        if self._commits is not None:
            self._commits.wait(SAFETY_INTERVAL_S)
