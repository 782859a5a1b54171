"""Hears of changed jobs: from PostgreSQL by LISTEN, one connection of a process; of SQLite by its log.

The trigger `cusp_job_changed` (migration 0013) sends the id of a job with each change that clients see. A
server that restarts, or a pooler of connections that passes no notices on, costs only speed: `JobWatch` then
asks. SQLite tells of commits only, so `JobWatch` looks at all watched jobs then.
"""

import asyncio
from collections.abc import Callable
from typing import Any, Protocol

import psycopg
import structlog
from sqlalchemy import make_url

from service.storage.commit_watch import CommitWatch

CHANNEL = "cusp_jobs"
CONNECT_TIMEOUT_S = 10
RETRY_S = 1.0  # between two attempts to connect
#: So that a server that vanished without a word is noticed within 25 s.
KEEPALIVES: dict[str, Any] = {"keepalives_idle": 10, "keepalives_interval": 5, "keepalives_count": 3}
log = structlog.get_logger()


class JobNotices(Protocol):
    """is_listening : False while changes may go unheard"""

    is_listening: bool

    async def listen(self, changed: Callable[[str | None], None]) -> None:
        """Call `changed` with the id of each job that changed, until cancelled; None: any may have."""


class CommitNotices:
    """Of SQLite: any job may have changed with each commit. database : URL"""

    def __init__(self, database: str) -> None:
        self._database = database
        self.is_listening = False

    async def listen(self, changed: Callable[[str | None], None]) -> None:
        """See JobNotices."""
        loop = asyncio.get_running_loop()
        if (commits := CommitWatch.of(self._database)) is None:
            return

        later: asyncio.TimerHandle | None = None

        def look() -> None:
            nonlocal later
            if commits.has_commit():
                changed(None)
            if later is not None:
                later.cancel()
            pause_s = commits.pause_s()
            later = None if pause_s is None else loop.call_later(pause_s, look)

        loop.add_reader(commits.fd, look)
        self.is_listening = True
        try:
            changed(None)
            await loop.create_future()
        finally:
            self.is_listening = False
            loop.remove_reader(commits.fd)
            if later is not None:
                later.cancel()
            commits.close()


class PostgresNotices:
    """conninfo : of libpq"""

    def __init__(self, conninfo: str) -> None:
        self._conninfo = conninfo
        self.is_listening = False

    async def listen(self, changed: Callable[[str | None], None]) -> None:
        """See JobNotices. None when listening began, and when it ended: what changed in between is not
        known.
        """
        while True:
            try:
                connection = await psycopg.AsyncConnection.connect(
                    self._conninfo, autocommit=True, connect_timeout=CONNECT_TIMEOUT_S, **KEEPALIVES
                )
                async with connection:
                    await connection.execute(f"LISTEN {CHANNEL}".encode())
                    self.is_listening = True
                    changed(None)
                    async for notice in connection.notifies():
                        changed(notice.payload)
            except psycopg.Error as error:
                log.debug("no notices of changed jobs", reason=" ".join(str(error).split()))
            finally:
                self.is_listening = False
            changed(None)
            await asyncio.sleep(RETRY_S)


def change_notices(database: str) -> JobNotices:
    """Those of a database, by its URL."""
    url = make_url(database)
    if url.get_backend_name() != "postgresql":
        return CommitNotices(database)
    return PostgresNotices(url.set(drivername="postgresql").render_as_string(hide_password=False))
