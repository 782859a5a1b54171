"""What runs next: DBOS on SQLite or PostgreSQL behind two small classes, so that the rest of the service never sees it.

Our jobs table is the truth; a DBOS workflow is only the ticket that brings a job to a worker, and has the job's id.
Traps of DBOS that this file knows: recovery at launch is for the same executor id and application version only, so
both are fixed; queues poll every second unless told; its clock on SQLite has 1 s resolution before Python 3.12.
"""

import sqlite3
from collections.abc import Callable, Sequence
from contextlib import closing
from typing import Protocol

from dbos import DBOS, DBOSClient, DBOSConfig
from sqlalchemy import make_url

APPLICATION = "cusp"
APPLICATION_VERSION = "1"  # of the workflow's contract (one argument, the job id), not of the product
QUEUE = "jobs"
WORKFLOW = "run_job"
POLLING_INTERVAL_S = 0.05
MAX_PRIORITY = 2**31 - 1  # of DBOS; the least runs first


class Queue(Protocol):
    """What the API and the reaper need of a queue."""

    def enqueue(self, job_id: str, turn: int) -> None:
        """Have a worker run the job, those with the least `turn` first. Again for the same job: nothing."""

    def drop(self, job_ids: Sequence[str]) -> None:
        """Forget jobs that wait."""

    def requeue(self, job_id: str, turn: int) -> None:
        """Have a worker run a job whose ticket was used up or is held by a dead worker."""

    def tickets(self) -> dict[str, str | None]:
        """Jobs whose ticket waits (None) or is held by a worker (its name)."""


def migrate_queue(url: str) -> None:
    """Make or update DBOS's tables."""
    if (parts := make_url(url)).get_backend_name() == "sqlite":
        with closing(sqlite3.connect(parts.database or "")) as connection:
            connection.execute("PRAGMA journal_mode=WAL")  # stays with the file; DBOS does not set it
    DBOS.migrate(url)


class DbosQueue:
    """The queue as seen from any process; it runs nothing itself."""

    def __init__(self, url: str) -> None:
        self._client = DBOSClient(system_database_url=url, application_name=APPLICATION)

    def close(self) -> None:
        """Drop the connections."""
        self._client.destroy()

    def enqueue(self, job_id: str, turn: int) -> None:
        """See Queue."""
        self._client.enqueue(
            {
                "workflow_name": WORKFLOW,
                "queue_name": QUEUE,
                "workflow_id": job_id,
                "app_version": APPLICATION_VERSION,
                "priority": min(max(turn, 1), MAX_PRIORITY),
            },
            job_id,
        )

    def drop(self, job_ids: Sequence[str]) -> None:
        """See Queue. A ticket that a worker holds already is void, since the row says dismissed."""
        self._client.cancel_workflows(list(job_ids))

    def requeue(self, job_id: str, turn: int) -> None:
        """See Queue."""
        if self._status(job_id) in ("SUCCESS", "ERROR", "CANCELLED", "MAX_RECOVERY_ATTEMPTS_EXCEEDED"):
            self._client.delete_workflow(job_id)  # resuming does nothing to a finished workflow
        if self._status(job_id) is None:
            self.enqueue(job_id, turn)
        else:
            self._client.resume_workflow(job_id, queue_name=QUEUE)

    def tickets(self) -> dict[str, str | None]:
        """See Queue."""
        active = self._client.list_workflows(
            status=["ENQUEUED", "PENDING"], load_input=False, load_output=False
        )
        return {each.workflow_id: each.executor_id if each.status == "PENDING" else None for each in active}

    def _status(self, job_id: str) -> str | None:
        found = self._client.list_workflows(workflow_ids=[job_id], load_input=False, load_output=False)
        return found[0].status if found else None


class DbosRunner:
    """The worker's side: brings each ticket to `run`, in a thread of its own, `parallel` at a time.

    One in a process, since DBOS is a singleton.
    """

    def __init__(self, url: str, worker_id: str, parallel: int, run: Callable[[str], None]) -> None:
        self._url, self._worker_id, self._parallel, self._run = url, worker_id, parallel, run

    def start(self) -> None:
        """From now on, jobs run; first those that this worker held when it died."""
        config: DBOSConfig = {
            "name": APPLICATION,
            "system_database_url": self._url,
            "executor_id": self._worker_id,
            "application_version": APPLICATION_VERSION,
            "run_migrations": False,
            "log_level": "WARNING",
        }
        DBOS(config=config)
        run = self._run

        @DBOS.workflow(name=WORKFLOW, max_recovery_attempts=None)  # the cap is ours: jobs.MAX_CRASHES
        def run_job(job_id: str) -> None:
            run(job_id)

        DBOS.launch()
        DBOS.register_queue(
            QUEUE,
            worker_concurrency=self._parallel,
            polling_interval_sec=POLLING_INTERVAL_S,
            on_conflict="always_update",
        )

    def stop(self) -> None:
        """Take no more tickets. Threads that run go on: end the process after this."""
        DBOS.destroy(workflow_completion_timeout_sec=0)
