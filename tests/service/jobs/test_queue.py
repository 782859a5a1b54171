"""DBOS behind our interface: tickets bring jobs to a runner once each, and can be dropped and made again."""

import threading
from collections.abc import Iterator
from typing import Any

import pytest
from dbos import DBOS

from service.jobs.queue import QUEUE, DbosQueue, DbosRunner, migrate_queue
from service.settings import ServiceSettings
from tests.support.running import wait_until

pytestmark = pytest.mark.storages


@pytest.fixture
def url(storage: dict[str, Any]) -> str:
    settings = ServiceSettings(**storage)
    migrate_queue(settings.queue)
    migrate_queue(settings.queue)  # again is nothing
    return settings.queue


@pytest.fixture
def queue(url: str) -> Iterator[DbosQueue]:
    made = DbosQueue(url)
    yield made
    made.close()


def test_each_ticket_runs_once_and_a_dropped_one_never(url: str, queue: DbosQueue) -> None:
    ran: list[str] = []
    gate = threading.Event()

    def run(job_id: str) -> None:
        ran.append(job_id)
        gate.wait(60)

    for job_id in ("a", "b", "b", "c"):
        queue.enqueue(job_id, 2)
    queue.drop(["c"])
    assert queue.entries() == {"a": None, "b": None}
    runner = DbosRunner(url, "worker-1", 1, run)
    runner.start()
    try:
        wait_until(lambda: ran == ["a"], 60, "the first job")
        assert queue.entries() == {"a": "worker-1", "b": None}  # one at a time; both are somebody's
        gate.set()
        wait_until(lambda: ran == ["a", "b"], 60, "the second job")
        wait_until(lambda: not queue.entries(), 60, "both entries to be used up")
        queue.requeue("a", 2)  # its row said that it waits, though its ticket is used up
        queue.requeue("c", 2)
        wait_until(lambda: sorted(ran) == ["a", "a", "b", "c"], 60, "both again")
    finally:
        runner.stop()
        DBOS.destroy(destroy_registry=True)


def test_the_queue_is_known_before_dbos_looks_for_queues(
    url: str, queue: DbosQueue, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It looks once a second: a queue that came later made the first job wait for that."""
    known: list[object] = []
    launch = DBOS.launch
    monkeypatch.setattr(DBOS, "launch", lambda: (known.append(queue._client.retrieve_queue(QUEUE)), launch()))
    runner = DbosRunner(url, "worker-1", 1, lambda _: None)
    runner.start()
    try:
        assert len(known) == 1 and known[0] is not None
    finally:
        runner.stop()
        DBOS.destroy(destroy_registry=True)
