"""The database tells of changed jobs; when it cannot, the watch asks, and hears all the same."""

import asyncio
from collections.abc import Callable

import psycopg
import pytest

from service.api.job_notices import PostgresNotices, change_notices
from service.api.job_watch import JobWatch
from service.contract.schemas import Status
from tests.service.api.test_job_watch import Counting
from tests.support.service import Service

pytestmark = pytest.mark.storages
CUT = "SELECT pg_terminate_backend(pid) FROM pg_stat_activity WHERE query = 'LISTEN cusp_jobs'"


async def until(condition: Callable[[], bool]) -> None:
    while not condition():  # a test has its limit of time
        await asyncio.sleep(0.01)


def test_a_change_is_told_by_the_database_and_found_without_it(service: Service) -> None:
    """With notices the watch looks twice, not every 0.1 s; when the connection is cut, it asks, and listens
    again later.
    """
    notices = change_notices(service.settings.database)
    jobs, job_id = Counting(service.jobs), service.submitted()

    async def watched() -> None:
        watch = JobWatch(jobs, 10, notices)
        async with watch.of(job_id, "default") as one:
            await until(lambda: one.version > 0 and notices.is_listening)
            await asyncio.to_thread(service.jobs.claim, job_id, "worker-1")
            await until(lambda: one.row is not None and one.row.status is Status.RUNNING)
            looks = jobs.looks
            await asyncio.sleep(0.5)
            assert jobs.looks <= looks + 1
            if isinstance(notices, PostgresNotices):
                await asyncio.to_thread(cut, notices)
            await asyncio.to_thread(service.jobs.beat, job_id, 1, message="told without a connection")
            await until(lambda: one.row is not None and one.row.message == "told without a connection")
            await until(lambda: notices.is_listening)
            await asyncio.to_thread(service.jobs.dismiss, job_id, Status.RUNNING)
            await until(lambda: one.row is not None and one.row.status is Status.DISMISSED)
        await watch.close()

    asyncio.run(watched())


def cut(notices: PostgresNotices) -> None:
    with psycopg.connect(notices._conninfo, autocommit=True) as connection:
        connection.execute(CUT)


def test_a_heartbeat_is_no_change(service: Service) -> None:
    notices = change_notices(service.settings.database)
    if not isinstance(notices, PostgresNotices):  # which hears of commits only
        return
    job_id = service.submitted()
    service.jobs.claim(job_id, "worker-1")

    async def told() -> list[str | None]:
        heard: list[str | None] = []
        listener = asyncio.create_task(notices.listen(heard.append))
        await until(lambda: heard == [None])
        await asyncio.to_thread(service.jobs.beat, job_id, 1)
        await asyncio.to_thread(service.jobs.beat, job_id, 1, progress=1.0)
        await until(lambda: len(heard) > 1)
        listener.cancel()
        await asyncio.gather(listener, return_exceptions=True)
        return heard

    assert asyncio.run(told()) == [None, job_id]


def test_a_database_that_does_not_answer_is_no_error() -> None:
    """The watch asks, and its own query says what is wrong."""
    notices = PostgresNotices("host=127.0.0.1 port=1 dbname=none connect_timeout=2")

    async def told() -> list[str | None]:
        heard: list[str | None] = []
        listener = asyncio.create_task(notices.listen(heard.append))
        await until(lambda: bool(heard))
        listener.cancel()
        await asyncio.gather(listener, return_exceptions=True)
        return heard

    assert asyncio.run(told()) == [None]
    assert not notices.is_listening
