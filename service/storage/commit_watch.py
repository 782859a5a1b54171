"""Hears of commits to an SQLite database by any process: inotify on its write-ahead log.

The log is written at each commit, and all processes of such a database run on one machine, since they share
memory. So nobody has to ask again and again whether there is something new.
"""

import ctypes
import os
import select
import struct
from pathlib import Path
from typing import Self

from sqlalchemy import make_url

IN_MODIFY, IN_CREATE = 0x2, 0x100  # <sys/inotify.h>
EVENT = struct.Struct("iIII")  # of inotify(7): watch, mask, cookie, bytes of the name that follows
BUFFER_BYTES = 64 * 1024


class CommitWatch:
    """fd : readable when files beside the database changed; `clear` tells whether its log was among them"""

    def __init__(self, database: Path) -> None:
        self._name = os.fsencode(f"{database.name}-wal")
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
        """Wait for a change beside the database; True if it was a commit."""
        return bool(select.select([self.fd], [], [], timeout_s)[0]) and self.clear()

    def clear(self) -> bool:
        """Forget what happened so far; True if there was a commit, or more than the system remembers."""
        try:
            events = os.read(self.fd, BUFFER_BYTES)
        except BlockingIOError:
            return False
        at, is_commit = 0, False
        while at < len(events):
            watch, _, _, length = EVENT.unpack_from(events, at)
            at += EVENT.size + length
            is_commit |= watch < 0 or events[at - length : at].rstrip(b"\0") == self._name
        return is_commit

    def close(self) -> None:
        """Stop to watch."""
        os.close(self.fd)


def _checked(result: int) -> int:
    if result < 0:
        raise OSError(ctypes.get_errno(), os.strerror(ctypes.get_errno()))
    return result
