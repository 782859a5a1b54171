"""One row that cannot be read (damaged, or of a later version) is one job's trouble: lists, ends, the reaper
and /metrics go on.
"""

import threading
import time
from typing import Any

import pytest

from service.execution.periodic import PeriodicTask
from service.jobs.models import now_ms
from service.jobs.reaper import DEAD_AFTER_MS, Reaper
from service.jobs.store import JobStore
from tests.support.service import Service, spoil

pytestmark = pytest.mark.storages

DAMAGE: dict[str, dict[str, str]] = {
    "type": {"type": "of_a_later_version"},
    "status": {"status": "paused"},
    "inputs": {"inputs": "[1]"},
    "stage": {"stage": "of_a_later_version"},
}
OF_SQLITE = {"json": {"options": "{"}}  # PostgreSQL refuses text that is not JSON


@pytest.mark.parametrize("kind", [*DAMAGE, *OF_SQLITE])
def test_a_list_leaves_out_what_cannot_be_read_and_shows_the_rest(service: Service, kind: str) -> None:
    if kind in OF_SQLITE and not service.settings.is_embedded:
        return
    ids = [service.submitted() for _ in range(4)]
    spoil(service, ids[2], **(DAMAGE | OF_SQLITE)[kind])
    first = service.http.get("/v1/jobs", params={"limit": 2}).json()
    second = service.http.get("/v1/jobs", params={"limit": 2, "cursor": first["next"]}).json()
    assert [job["id"] for job in first["jobs"]] == [ids[3]]
    assert ([job["id"] for job in second["jobs"]], second["next"]) == ([ids[1], ids[0]], None)
    assert service.http.get("/metrics").status_code == 200


@pytest.mark.parametrize(
    "damage", [{"options": "[1]"}, {"options": '"words"'}, {"type": "of_a_later_version"}]
)
def test_a_job_whose_webhook_cannot_be_read_ends_all_the_same(
    service: Service, damage: dict[str, str]
) -> None:
    waits, runs = service.submitted(), service.submitted('{"webhook": {"url": "http://93.184.216.34/"}}')
    assert service.jobs.claim(runs, "worker-2") is not None
    for job_id in (waits, runs):
        spoil(service, job_id, **damage)
        assert service.http.delete(f"/v1/jobs/{job_id}").status_code == 204
    assert service.jobs.count("dismissed") == 2  # type: ignore[arg-type]


def test_a_job_that_cannot_be_handed_on_or_queued_holds_up_no_other(
    service: Service, monkeypatch: pytest.MonkeyPatch
) -> None:
    ids = [service.submitted() for _ in range(3)]
    assert service.waiting == ids
    for job_id in ids:
        assert service.jobs.claim(job_id, "worker-7") is not None
    service.queue.waiting.clear()
    reassign, requeue = service.jobs.reassign, service.queue.requeue

    def reassigning(row: Any, *given: Any) -> Any:
        if row.id == ids[0]:
            raise ValueError("odd")
        return reassign(row, *given)

    def requeuing(job_id: str, turn: int) -> None:
        if job_id == ids[1]:
            raise KeyError("odd")
        requeue(job_id, turn)

    monkeypatch.setattr(service.jobs, "reassign", reassigning)
    monkeypatch.setattr(service.queue, "requeue", requeuing)
    monkeypatch.setattr(JobStore, "now_ms", lambda _: now_ms() + DEAD_AFTER_MS + 1000)
    reaper = Reaper(service.jobs, service.queue)
    reaper.at_start("worker-7")
    reaper.sweep()
    assert service.queue.waiting == [ids[2]]


def test_a_chore_that_fails_or_hangs_holds_up_no_other_and_is_done_again() -> None:
    stop, hang, done = threading.Event(), threading.Event(), threading.Event()
    calls: list[float] = []

    def fail_first() -> None:
        calls.append(time.monotonic())
        if len(calls) == 1:
            raise ValueError("odd")
        done.set()

    PeriodicTask("hangs", hang.wait, 0.01).begin(stop)  # type: ignore[arg-type]
    thread = PeriodicTask("fails", fail_first, 0.01, after_error_s=0.2).begin(stop)
    assert done.wait(5)
    assert calls[1] - calls[0] >= 0.2
    stop.set()
    hang.set()
    thread.join(5)
    assert not thread.is_alive()
