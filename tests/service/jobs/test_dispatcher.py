"""A job is queued when the database tells of its commit; nobody asks in between."""

import queue
import threading
from collections.abc import Sequence

import pytest

from service.jobs.dispatcher import Dispatcher
from service.jobs.models import JobRow, new_id
from service.jobs.store import JobStore
from service.settings import ServiceSettings
from service.storage.commit_watch import CommitWatch
from service.storage.database import migrate, open_database


class Passes(JobStore):
    """Tells of each pass of the dispatcher."""

    def __init__(self, database: str) -> None:
        super().__init__(open_database(database))
        self.passed: queue.Queue[None] = queue.Queue()

    def dismissed_with_queue_entry(self, limit: int) -> Sequence[str]:
        found = super().dismissed_with_queue_entry(limit)
        self.passed.put(None)
        return found


class Entries(queue.Queue[str]):
    """Entries of a queue, in their order."""

    def enqueue(self, job_id: str, rank: int) -> None:
        self.put(job_id)


def test_a_commit_starts_a_pass(settings: ServiceSettings, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("service.jobs.dispatcher.SAFETY_INTERVAL_S", 600.0)
    migrate(settings.database)
    jobs, entries, stop = Passes(settings.database), Entries(), threading.Event()
    dispatcher = Dispatcher(jobs, entries, CommitWatch.of(settings.database))  # type: ignore[arg-type]
    threading.Thread(target=dispatcher.run, args=(stop,), daemon=True).start()
    jobs.passed.get(timeout=10)
    ids = []
    for _ in range(3):
        row = JobRow(id=new_id(), tenant="default", type="study", inputs={}, options={}, attempt=0, crashes=0)
        jobs.add(row)
        ids.append(row.id)
        assert entries.get(timeout=10) == row.id
    stop.set()
    assert jobs.passed.qsize() <= 3 * len(ids)  # for each: it came, it was noted, and one to spare
