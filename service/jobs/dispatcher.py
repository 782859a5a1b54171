"""Gives accepted jobs their tickets for the queue, and takes back those of dismissed ones.

The API only writes rows: it needs no queue, and a queue that is away refuses nobody's job. Any number of workers may do this
at once, since a job's ticket has the job's id.
"""

import threading

import structlog

from service.jobs.queue import Queue
from service.jobs.store import JobStore

LOOK_INTERVAL_S = 0.05
BATCH = 100  # of dismissed ones at a time, so that they hold up nobody
log = structlog.get_logger()


class TicketDesk:
    """Call `serve` often, or `run` in a thread."""

    def __init__(self, jobs: JobStore, queue: Queue) -> None:
        self._jobs, self._queue = jobs, queue

    def serve(self) -> None:
        """Once: tickets for jobs that have none, none for jobs that are dismissed."""
        for job_id, turn in self._jobs.without_ticket(BATCH).items():
            self._queue.enqueue(job_id, turn)
            self._jobs.note_ticket([job_id], has_ticket=True)
        if dismissed := self._jobs.dismissed_with_ticket(BATCH):
            self._queue.drop(dismissed)
            self._jobs.note_ticket(dismissed, has_ticket=False)

    def run(self, stop: threading.Event) -> None:
        """Until `stop`."""
        while not stop.wait(LOOK_INTERVAL_S):
            try:
                self.serve()
            except Exception:
                log.exception("tickets wait")  # a database that is away, most likely
                stop.wait(1.0)
