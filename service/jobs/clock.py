"""One clock for all machines: that of the database server. Machines may be set a minute apart, and a worker
must not take the others for dead.

With SQLite there is one machine, and its own clock.
"""

import threading
import time
from collections.abc import Callable

from sqlalchemy import Engine, text

from service.jobs.models import now_ms
from service.storage.retry import DATABASE_UNAVAILABLE

RENEW_MS = 60_000  # quartz of two machines differs by some ms in that time
SERVER_TIME = text("SELECT (extract(epoch FROM clock_timestamp()) * 1000)::bigint")


class ServerClock:
    """Milliseconds since 1970 of a PostgreSQL server: asked once a minute, counted here in between.

    Safe to share between threads.
    """

    def __init__(self, engine: Engine, since_boot_ms: Callable[[], int]) -> None:
        self._engine, self._since_boot_ms = engine, since_boot_ms
        self._ahead_ms: int | None = None  # the server's clock, of that since the boot
        self._renew_at_ms = 0
        self._asking = threading.Lock()

    def __call__(self) -> int:
        """Raises what the database raises, if it never answered."""
        is_due = self._ahead_ms is None or self._since_boot_ms() >= self._renew_at_ms
        # Only one asks, and others wait for it only if there is no answer of before.
        if is_due and self._asking.acquire(blocking=self._ahead_ms is None):
            try:
                self._renew()
            finally:
                self._asking.release()
        assert self._ahead_ms is not None  # noqa: S101 (the lock saw to it)
        return self._since_boot_ms() + self._ahead_ms

    def _renew(self) -> None:
        if self._ahead_ms is not None and self._since_boot_ms() < self._renew_at_ms:
            return  # another thread has asked meanwhile
        before = self._since_boot_ms()
        try:
            with self._engine.connect() as connection:
                server_ms = int(connection.execute(SERVER_TIME).scalar_one())
        except DATABASE_UNAVAILABLE:
            if self._ahead_ms is None:
                raise
            return
        after = self._since_boot_ms()
        self._ahead_ms, self._renew_at_ms = server_ms - (before + after) // 2, after + RENEW_MS


def clock_of(engine: Engine) -> Callable[[], int]:
    """The clock that all processes of a database share, ms since 1970."""
    return ServerClock(engine, since_boot_ms) if engine.dialect.name == "postgresql" else now_ms


def since_boot_ms() -> int:
    """Counts while the machine sleeps, and does not jump when its clock is set."""
    return time.clock_gettime_ns(time.CLOCK_BOOTTIME) // 1_000_000
