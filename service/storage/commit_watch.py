"""Hears of commits to an SQLite database by any process: inotify on its write-ahead log.

The log is written at each commit, and all processes of such a database run on one machine, since they share
memory. So nobody has to ask again and again whether there is something new.

A commit is written to the log, flushed to the disk, and only then shown to readers, by a change of shared
memory of which inotify does not tell. So after each write the database itself is asked whether it shows
something new, at once and then at growing intervals.
"""

import ctypes
import os
import select
import sqlite3
import struct
import time
from pathlib import Path
from typing import Self

from sqlalchemy import make_url

IN_MODIFY, IN_CREATE = 0x2, 0x100  # <sys/inotify.h>
EVENT = struct.Struct("iIII")  # of inotify(7): watch, mask, cookie, bytes of the name that follows
BUFFER_BYTES = 64 * 1024
#: From a write of the log to the first look after the one at once; each next pause is as long as all before.
#: A look takes some 0.02 ms, a flush of the disk 1 to 10.
FIRST_PAUSE_S = 0.001
SHOWN_WITHIN_S = (
    2.0  # a disk that takes longer to flush: the safety looks of the listeners see the commit then
)


class CommitWatch:
    """fd : readable when files beside the database changed: call `has_commit` then, and after `pause_s`"""

    def __init__(self, database: Path) -> None:
        self._name = os.fsencode(f"{database.name}-wal")
        # Only asks for the version. The thread that waits need not be the one that makes the watch.
        self._reader = sqlite3.connect(database, timeout=0, isolation_level=None, check_same_thread=False)
        self._version = 0
        self._version = self._shown_version()
        self._written_at = -SHOWN_WITHIN_S  # monotonic
        libc = ctypes.CDLL(None, use_errno=True)
        self.fd = _checked(libc.inotify_init1(os.O_NONBLOCK | os.O_CLOEXEC))
        try:
            _checked(libc.inotify_add_watch(self.fd, os.fsencode(database.parent), IN_MODIFY | IN_CREATE))
        except OSError:
            self.close()
            raise

    @classmethod
    def of(cls, url: str) -> Self | None:
        """The watch of a database; None for PostgreSQL, and where the system has no inotify (left)."""
        parts = make_url(url)
        if parts.get_backend_name() != "sqlite" or not parts.database:
            return None
        try:
            return cls(Path(parts.database).absolute())
        except (OSError, AttributeError):
            return None

    def wait(self, timeout_s: float) -> bool:
        """Wait for a commit; True if there was one."""
        until = time.monotonic() + timeout_s
        while (left_s := until - time.monotonic()) > 0:
            pause_s = self.pause_s()
            select.select([self.fd], [], [], left_s if pause_s is None else min(left_s, pause_s))
            if self.has_commit():
                return True
        return False

    def has_commit(self) -> bool:
        """True if the database shows a commit that it did not show at the last call."""
        if self._log_was_written():
            self._written_at = time.monotonic()
        elif self.pause_s() is None:
            return False
        version = self._shown_version()
        is_new = version != self._version
        self._version = version
        return is_new

    def pause_s(self) -> float | None:
        """When to call `has_commit` although `fd` is not readable; None: not at all."""
        age_s = time.monotonic() - self._written_at
        return max(FIRST_PAUSE_S, age_s) if age_s < SHOWN_WITHIN_S else None

    def _shown_version(self) -> int:
        """Changes with each commit of another connection that this one can see."""
        try:
            return int(self._reader.execute("PRAGMA data_version").fetchone()[0])
        except (
            sqlite3.Error
        ):  # locked while another process opens the log; or the disk fails: others will say
            return self._version

    def _log_was_written(self) -> bool:
        """Forget what happened so far; True if the log was written, or more happened than is kept."""
        try:
            events = os.read(self.fd, BUFFER_BYTES)
        except BlockingIOError:
            return False
        at, is_written = 0, False
        while at < len(events):
            watch, _, _, length = EVENT.unpack_from(events, at)
            at += EVENT.size + length
            is_written |= watch < 0 or events[at - length : at].rstrip(b"\0") == self._name
        return is_written

    def close(self) -> None:
        """Stop to watch."""
        os.close(self.fd)
        self._reader.close()


def _checked(result: int) -> int:
    if result < 0:
        raise OSError(ctypes.get_errno(), os.strerror(ctypes.get_errno()))
    return result
