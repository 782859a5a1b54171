"""Many watchers cost the database one query at a time, and each of them hears of every change."""

import asyncio
import threading
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import pytest

from service.api.job_watch import BATCH, JobWatch
from service.contract.errors import TooManyWatchers
from service.contract.schemas import Status
from service.jobs.store import JobStore
from tests.support.service import Service, assert_problem

pytestmark = pytest.mark.storages
WATCHERS = 5 * BATCH  # woken in turns; `python -m tests.endurance.watchers` has 2,000


class Counting(JobStore):
    """Counts what the watch asks."""

    def __init__(self, jobs: JobStore) -> None:
        self.__dict__.update(jobs.__dict__)
        self.looks = self.loads = 0
        self.fails = False

    def fingerprints(self, job_ids: Any) -> dict[str, tuple[object, ...]]:
        self.looks += 1
        if self.fails:
            raise ConnectionError("the database is away")
        return super().fingerprints(job_ids)

    def find_kept(self, job_id: str) -> Any:
        self.loads += 1
        return super().find_kept(job_id)


async def until_final(watch: JobWatch, job_id: str) -> list[str]:
    seen: list[str] = []
    async with watch.of(job_id, "default") as watched:
        version = 0
        while await watched.newer(version, 30.0):
            version = watched.version
            assert watched.row is not None
            seen.append(watched.row.status.value)
            if watched.row.status.is_final:
                break
    return seen


def test_many_watchers_share_one_look(service: Service) -> None:
    """Each of them hears of the start and of the end, and the row is loaded once for each change."""
    jobs, job_id = Counting(service.jobs), service.submitted()

    async def watched() -> list[list[str]]:
        watch = JobWatch(jobs, 5000)
        watchers = [asyncio.create_task(until_final(watch, job_id)) for _ in range(WATCHERS)]
        while jobs.loads == 0:
            await asyncio.sleep(0.01)
        await asyncio.to_thread(service.jobs.claim, job_id, "worker-1")
        while jobs.loads == 1:
            await asyncio.sleep(0.01)
        await asyncio.to_thread(service.jobs.dismiss, job_id, Status.RUNNING)
        seen = await asyncio.gather(*watchers)
        assert jobs.loads == 3
        await watch.close()
        return seen

    seen = asyncio.run(watched())
    assert len(seen) == WATCHERS
    assert all(each == ["accepted", "running", "dismissed"] for each in seen)


def test_a_watch_that_nobody_holds_asks_nothing(service: Service) -> None:
    jobs, job_id = Counting(service.jobs), service.finished()

    async def watched() -> None:
        watch = JobWatch(jobs, 1)
        assert await until_final(watch, job_id) == ["successful"]
        assert watch._task is not None
        await asyncio.wait_for(watch._task, 10)  # it ends by itself
        async with watch.of(job_id, "default"):
            with pytest.raises(TooManyWatchers):
                watch.check_room("default")
            watch.check_room("another")
        await watch.close()

    asyncio.run(watched())


def test_a_database_that_is_away_is_told_and_asked_again(service: Service) -> None:
    jobs, job_id = Counting(service.jobs), service.finished()

    async def watched() -> None:
        watch = JobWatch(jobs, 10)
        jobs.fails = True
        with pytest.raises(ConnectionError):
            await until_final(watch, job_id)
        jobs.fails = False
        assert await until_final(watch, job_id) == ["successful"]
        await watch.close()

    asyncio.run(watched())


def test_a_long_poll_hears_of_the_end_and_of_a_removal(service: Service) -> None:
    done, removed = service.submitted(), service.submitted()

    def poll(job_id: str) -> Any:
        return service.http.get(f"/v1/jobs/{job_id}", headers={"Prefer": "wait=30"})

    with ThreadPoolExecutor(2) as pool:
        first, second = pool.submit(poll, done), pool.submit(poll, removed)
        threading.Event().wait(0.3)  # both wait now
        service.worker.run(done)
        service.jobs.dismiss(removed, Status.ACCEPTED)
        assert first.result(30).json()["status"] == "successful"
        assert second.result(30).json()["status"] == "dismissed"


def test_too_many_watchers_of_a_tenant_are_refused(service: Service, monkeypatch: pytest.MonkeyPatch) -> None:
    job_id = service.submitted()
    monkeypatch.setattr(JobWatch, "check_room", _refuse)
    for answer in (
        service.http.get(f"/v1/jobs/{job_id}/events"),
        service.http.get(f"/v1/jobs/{job_id}", headers={"Prefer": "wait=30"}),
    ):
        assert_problem(answer, 429, "too_many_watchers")
    assert service.http.get(f"/v1/jobs/{job_id}").status_code == 200


def _refuse(*_: Any) -> None:
    raise TooManyWatchers("5000 requests of this tenant wait for jobs")
