"""Watches jobs for all long polls and event streams of this process, with one query for all of them.

Each watcher that asked the database itself would cost it a query every 0.1 s. Here one task asks for what
changed of all watched jobs, loads a row when it changed, and wakes its watchers, a few at a time, so that
other requests are answered in between. PostgreSQL says itself which jobs changed, SQLite that some did; while
neither can, the task asks every 0.1 s.
"""

import asyncio
import time
from collections import Counter
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, suppress
from dataclasses import dataclass, field

from fastapi.concurrency import run_in_threadpool
from fastapi.sse import format_sse_event

from service.api.job_notices import JobNotices
from service.contract.errors import TooManyWatchers
from service.jobs.models import JobRow
from service.jobs.store import JobStore
from service.jobs.views import job_of

INTERVAL_S = 0.1  # between two looks while nobody tells of changes
TOLD_INTERVAL_S = 0.02  # between two looks, however often the database tells of changes
#: Between two looks at all watched jobs while the database tells of changes, should a notice get lost.
SAFETY_INTERVAL_S = 2.0
PING_INTERVAL_S = 15.0  # of streams without an event, so that proxies keep them open
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
    _event: bytes | None = None
    _waiting: dict["asyncio.Future[None]", None] = field(default_factory=dict)  # in their order

    async def newer(self, version: int, timeout_s: float | None = None) -> bool:
        """Wait for a version after `version`; False if none came in time. Raises what the database raised."""
        if self.version <= version and self.error is None:
            loop = asyncio.get_running_loop()
            woken = loop.create_future()
            self._waiting[woken] = None
            timer = None if timeout_s is None else loop.call_later(timeout_s, _wake, woken)
            try:
                await woken
            finally:
                if timer is not None:
                    timer.cancel()
                self._waiting.pop(woken, None)
        if self.error is not None:
            raise self.error
        return self.version > version

    def as_json(self) -> str:
        """The job as the API shows it, made once for all watchers."""
        assert self.row is not None  # noqa: S101 (the caller has looked)
        if self._json is None:
            self._json = job_of(self.row).model_dump_json()
        return self._json

    def as_event(self) -> bytes:
        """The same as a server-sent event."""
        if self._event is None:
            self._event = format_sse_event(event="status", data_str=self.as_json())
        return self._event

    async def changed(self, row: JobRow | None, error: Exception | None) -> None:
        """Note the change and wake the watchers."""
        self.row, self.error, self._json, self._event = row, error, None, None
        self.version += 1
        waiting, self._waiting = self._waiting, {}
        for number, woken in enumerate(waiting):
            _wake(woken)
            if number % BATCH == BATCH - 1:
                await asyncio.sleep(BATCH / WAKES_PER_S)


def _wake(woken: "asyncio.Future[None]") -> None:
    if not woken.done():
        woken.set_result(None)


class JobWatch:
    """Of one event loop."""

    def __init__(self, jobs: JobStore, tenant_limit: int, notices: JobNotices | None = None) -> None:
        self._jobs, self._tenant_limit, self._notices = jobs, tenant_limit, notices
        self._due: set[str] = set()  # jobs to look at
        self._all_due_at = 0.0  # monotonic; when to look at all of them
        self._wake = asyncio.Event()
        self._listener: asyncio.Task[None] | None = None
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
        if watched.version == 0:
            self._note(job_id)
        if self._notices is not None and self._listener is None:
            self._listener = asyncio.create_task(self._notices.listen(self._note))
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
                f"{self._tenant_limit} requests of this tenant are already waiting for jobs; poll without "
                "`wait`, or use webhooks"
            )

    async def close(self) -> None:
        """Stop looking."""
        for task in (self._task, self._listener):
            if task is not None:
                task.cancel()
                with suppress(asyncio.CancelledError):
                    await task

    def _note(self, job_id: str | None) -> None:
        """A job has changed; None: any may have."""
        if job_id is None:
            self._all_due_at = 0.0
        elif job_id in self._watched:
            self._due.add(job_id)
        else:
            return
        self._wake.set()

    def _take_due(self) -> dict[str, WatchedJob]:
        due, self._due = self._due, set()
        self._wake.clear()
        is_told = self._notices is not None and self._notices.is_listening
        now = time.monotonic()
        if not is_told or now >= self._all_due_at:
            self._all_due_at = now + SAFETY_INTERVAL_S if is_told else 0.0
            return dict(self._watched)
        return {job_id: self._watched[job_id] for job_id in due if job_id in self._watched}

    async def _pause(self) -> None:
        """Until the next look: at once after a notice, but not sooner than TOLD_INTERVAL_S after the last."""
        is_told = self._notices is not None and self._notices.is_listening
        await asyncio.sleep(TOLD_INTERVAL_S if is_told else INTERVAL_S)
        if self._all_due_at > 0.0:
            with suppress(TimeoutError):
                await asyncio.wait_for(self._wake.wait(), max(0.0, self._all_due_at - time.monotonic()))

    async def _run(self) -> None:
        while self._watched:
            watched = self._take_due()
            try:
                seen = await run_in_threadpool(self._jobs.fingerprints, list(watched))
            except Exception as error:
                for each in watched.values():
                    await each.changed(None, error)
                    self._forget(each)
            else:
                for job_id, each in watched.items():
                    await self._look(job_id, each, seen.get(job_id))
            await self._pause()

    async def _look(self, job_id: str, watched: WatchedJob, seen: tuple[object, ...] | None) -> None:
        if watched.version > 0 and seen == watched.seen:
            return
        if watched.waking is not None and not watched.waking.done():
            self._note(job_id)  # its many watchers hear of the last change first; others need not wait
            return
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
