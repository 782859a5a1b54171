"""The queue: DBOS on SQLite or PostgreSQL, behind two small classes. No other file of the service imports
DBOS.

The jobs table decides about a job. A DBOS workflow is only a queue entry: it has the id of the job and brings
it to a worker. Properties of DBOS that matter here: recovery at launch covers the same executor id and
application version only, so both are fixed; a queue polls every second unless configured; on SQLite its clock
has a resolution of 1 s before Python 3.12.
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
MAX_PRIORITY = 2**31 - 1  # of DBOS; the lowest runs first


class Queue(Protocol):
    """What the dispatcher and the reaper need of a queue."""

    def enqueue(self, job_id: str, rank: int) -> None:
        """Add an entry for the job; the lowest `rank` runs first. Does nothing if the job has an entry."""

    def drop(self, job_ids: Sequence[str]) -> None:
        """Remove the entries of waiting jobs."""

    def requeue(self, job_id: str, rank: int) -> None:
        """Make an entry available again that was consumed, or that a dead worker holds."""

    def entries(self) -> dict[str, str | None]:
        """Active entries: job id -> worker that holds it, None if it waits."""


def migrate_queue(url: str) -> None:
    """Create or update the tables of DBOS."""
    if (parts := make_url(url)).get_backend_name() == "sqlite":
        with closing(sqlite3.connect(parts.database or "")) as connection:
            connection.execute("PRAGMA journal_mode=WAL")  # stays with the file; DBOS does not set it
    DBOS.migrate(url)


class DbosQueue:
    """The queue for any process; it runs no jobs itself."""

    def __init__(self, url: str) -> None:
        self._client = DBOSClient(system_database_url=url, application_name=APPLICATION)

    def close(self) -> None:
        """Drop the connections."""
        self._client.destroy()

    def enqueue(self, job_id: str, rank: int) -> None:
        """See Queue."""
        self._client.enqueue(
            {
                "workflow_name": WORKFLOW,
                "queue_name": QUEUE,
                "workflow_id": job_id,
                "app_version": APPLICATION_VERSION,
                "priority": min(max(rank, 1), MAX_PRIORITY),
            },
            job_id,
        )

    def drop(self, job_ids: Sequence[str]) -> None:
        """See Queue. An entry that a worker holds already has no effect: the row says dismissed."""
        self._client.cancel_workflows(list(job_ids))

    def requeue(self, job_id: str, rank: int) -> None:
        """See Queue."""
        if self._status(job_id) in ("SUCCESS", "ERROR", "CANCELLED", "MAX_RECOVERY_ATTEMPTS_EXCEEDED"):
            self._client.delete_workflow(job_id)  # resuming does nothing to a finished workflow
        if self._status(job_id) is None:
            self.enqueue(job_id, rank)
        else:
            self._client.resume_workflow(job_id, queue_name=QUEUE)

    def entries(self) -> dict[str, str | None]:
        """See Queue."""
        active = self._client.list_workflows(
            status=["ENQUEUED", "PENDING"], load_input=False, load_output=False
        )
        return {each.workflow_id: each.executor_id if each.status == "PENDING" else None for each in active}

    def _status(self, job_id: str) -> str | None:
        workflows = self._client.list_workflows(workflow_ids=[job_id], load_input=False, load_output=False)
        return workflows[0].status if workflows else None


class DbosRunner:
    """The worker's side: calls `run` with the id of each entry, in a thread of its own, `parallel` at a time.

    One per process, since DBOS is a singleton.
    """

    def __init__(self, url: str, worker_id: str, parallel: int, run: Callable[[str], None]) -> None:
        self._url, self._worker_id, self._parallel, self._run = url, worker_id, parallel, run

    def start(self) -> None:
        """Start to run jobs; first those that this worker held when it died."""
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

        @DBOS.workflow(name=WORKFLOW, max_recovery_attempts=None)  # limited by models.MAX_CRASHES
        def run_job(job_id: str) -> None:
            run(job_id)

        self._register()
        DBOS.launch()

    def _register(self) -> None:
        """Before DBOS is launched: it looks for queues once a second, so that a later one makes jobs wait."""
        client = DBOSClient(system_database_url=self._url, application_name=APPLICATION)
        client.register_queue(
            QUEUE,
            worker_concurrency=self._parallel,
            polling_interval_sec=POLLING_INTERVAL_S,
            on_conflict="always_update",
        )
        client.destroy()

    def stop(self) -> None:
        """Take no more entries. Running threads continue: end the process after this."""
        DBOS.destroy(workflow_completion_timeout_sec=0)
