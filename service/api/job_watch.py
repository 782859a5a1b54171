"""Watches jobs for all long polls and event streams of this process, with one query for all of them.

Each watcher that asked the database itself would cost it a query every 0.1 s. Here one task asks for what
changed of all watched jobs, loads a row when it changed, and wakes its watchers, a few at a time, so that
other requests are answered in between.
"""

import asyncio
from collections import Counter
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, suppress
from dataclasses import dataclass, field

from fastapi.concurrency import run_in_threadpool

from service.contract.errors import TooManyWatchers
from service.jobs.models import JobRow
from service.jobs.store import JobStore
from service.jobs.views import job_of

INTERVAL_S = 0.1
BATCH = 20  # watchers that are woken at once, before other requests have a turn
#: Watchers of one job that are woken in a second, beyond the first BATCH. To send an event takes some 0.3 ms
#: of the processor: more would leave no time for other requests. Those who wait get the newest state.
WAKES_PER_S = 1000


@dataclass(eq=False)
class WatchedJob:
    """What is known of one job. version : 0 until the first look, then counts the changes"""

    watchers: int = 0
    version: int = 0
    row: JobRow | None = None  # None after the first look: it is unknown or removed
    seen: tuple[object, ...] | None = None
    error: Exception | None = None
    waking: "asyncio.Task[None] | None" = None
    _json: str | None = None
    _waiting: list["asyncio.Future[None]"] = field(default_factory=list)

    async def newer(self, version: int, timeout_s: float | None = None) -> bool:
        """Wait for a version after `version`; False if none came in time. Raises what the database raised."""
        if self.version <= version and self.error is None:
            woken = asyncio.get_running_loop().create_future()
            self._waiting.append(woken)
            try:
                await asyncio.wait_for(woken, timeout_s)
            except TimeoutError:
                pass
            finally:
                if woken in self._waiting:
                    self._waiting.remove(woken)
        if self.error is not None:
            raise self.error
        return self.version > version

    def as_json(self) -> str:
        """The job as the API shows it, made once for all watchers."""
        assert self.row is not None  # noqa: S101 (the caller has looked)
        if self._json is None:
            self._json = job_of(self.row).model_dump_json()
        return self._json

    async def changed(self, row: JobRow | None, error: Exception | None) -> None:
        """Note the change and wake the watchers."""
        self.row, self.error, self._json = row, error, None
        self.version += 1
        waiting, self._waiting = self._waiting, []
        for number, woken in enumerate(waiting):
            if not woken.done():
                woken.set_result(None)
            if number % BATCH == BATCH - 1:
                await asyncio.sleep(BATCH / WAKES_PER_S)


class JobWatch:
    """Of one event loop."""

    def __init__(self, jobs: JobStore, tenant_limit: int) -> None:
        self._jobs, self._tenant_limit = jobs, tenant_limit
        self._watched: dict[str, WatchedJob] = {}
        self._by_tenant: Counter[str] = Counter()
        self._task: asyncio.Task[None] | None = None

    @asynccontextmanager
    async def of(self, job_id: str, tenant: str) -> AsyncIterator[WatchedJob]:
        """Watch a job until the end of the block. The caller has checked whose it is.

        Raises TooManyWatchers.
        """
        self.check_room(tenant)
        watched = self._watched.setdefault(job_id, WatchedJob())
        watched.watchers += 1
        self._by_tenant[tenant] += 1
        if self._task is None or self._task.done():
            self._task = asyncio.create_task(self._run())
        try:
            yield watched
        finally:
            self._by_tenant[tenant] -= 1
            watched.watchers -= 1
            if watched.watchers == 0 and self._watched.get(job_id) is watched:
                del self._watched[job_id]

    def check_room(self, tenant: str) -> None:
        """Raise TooManyWatchers if the tenant has as many watchers as it may."""
        if self._by_tenant[tenant] >= self._tenant_limit:
            raise TooManyWatchers(
                f"{self._tenant_limit} requests of this tenant wait for jobs; poll without `wait`, "
                "or use webhooks"
            )

    async def close(self) -> None:
        """Stop looking."""
        if self._task is not None:
            self._task.cancel()
            with suppress(asyncio.CancelledError):
                await self._task

    async def _run(self) -> None:
        while self._watched:
            watched = dict(self._watched)
            try:
                seen = await run_in_threadpool(self._jobs.fingerprints, list(watched))
            except Exception as error:
                for each in watched.values():
                    await each.changed(None, error)
                    self._forget(each)
            else:
                for job_id, each in watched.items():
                    await self._look(job_id, each, seen.get(job_id))
            await asyncio.sleep(INTERVAL_S)

    async def _look(self, job_id: str, watched: WatchedJob, seen: tuple[object, ...] | None) -> None:
        if watched.version > 0 and seen == watched.seen:
            return
        if watched.waking is not None and not watched.waking.done():
            return  # its many watchers hear of the last change first, which others need not wait for
        row, error = None, None
        if seen is not None:
            try:
                row = await run_in_threadpool(self._jobs.find_kept, job_id)
            except Exception as failed:
                error = failed
        watched.seen = seen
        watched.waking = asyncio.create_task(watched.changed(row, error))
        if error is not None:
            self._forget(watched)

    def _forget(self, watched: WatchedJob) -> None:
        """Later watchers of the job start anew: what failed may work then."""
        for job_id in [job_id for job_id, each in self._watched.items() if each is watched]:
            del self._watched[job_id]
