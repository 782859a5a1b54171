"""Puts accepted jobs into the queue, and removes the entries of dismissed ones.

The API writes rows only: it needs no queue, so no job is refused when the queue is unavailable. Any number of
workers may dispatch at the same time, since a queue entry has the id of its job.
"""

import threading

import structlog

from service.jobs.queue import Queue
from service.jobs.store import JobStore

POLL_INTERVAL_S = 0.05
RETRY_AFTER_S = 1.0
BATCH = 100  # jobs per pass, so that no pass takes long
log = structlog.get_logger()


class Dispatcher:
    """Call `dispatch` often, or `run` in a thread."""

    def __init__(self, jobs: JobStore, queue: Queue) -> None:
        self._jobs, self._queue = jobs, queue

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
        while not stop.wait(POLL_INTERVAL_S):
            try:
                self.dispatch()
            except Exception:
                log.exception("jobs not dispatched")  # most likely the database is unavailable
                stop.wait(RETRY_AFTER_S)
