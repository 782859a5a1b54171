"""The heartbeat of a running job, from its claim to its end: also while meshes are fetched or results are
stored.

Each heartbeat writes the newest progress, and tells whether the job still belongs to this attempt, or was
dismissed or reassigned. Its thread is the only one that writes while a job computes, so a slow database
delays the progress that clients see, and nothing else.
"""

import threading
from collections.abc import Callable
from types import TracebackType
from typing import Any, Self

import structlog

from service.jobs.liveness import JOB_HEARTBEAT_S
from service.storage.retry import DATABASE_UNAVAILABLE

MIN_PROGRESS_WRITE_S = 0.05  # between two writes, however often the progress changes
log = structlog.get_logger()


class Heartbeat:
    """beat : writes one heartbeat with the progress it is given (`stage`, `progress`, `message`); False if
    the job does not belong to this attempt (any more)
    """

    def __init__(self, beat: Callable[..., bool]) -> None:
        self._beat = beat
        self._end = threading.Event()
        self._lost = threading.Event()
        self._news = threading.Event()  # there is newer progress, or the end
        self._newest: dict[str, Any] = {}
        self._thread = threading.Thread(target=self._run, name="heartbeat", daemon=True)

    @property
    def is_ours(self) -> bool:
        """False once the database answered that the job does not belong to this attempt."""
        return not self._lost.is_set()

    @property
    def newest(self) -> dict[str, Any]:
        """The newest progress, written or not; empty before the first."""
        return self._newest

    def note(self, stage: str, percent: float, message: str) -> None:
        """Have the next heartbeat, which follows at once, write this progress. Returns at once."""
        self._newest = {"stage": stage, "progress": percent, "message": message}
        self._news.set()

    def _run(self) -> None:
        while not self._end.is_set():
            self._news.wait(JOB_HEARTBEAT_S)
            if self._end.is_set():
                return
            self._news.clear()
            try:
                if not self._beat(**self._newest):
                    self._lost.set()
                    return
            except DATABASE_UNAVAILABLE:
                pass  # asked again when the database is back
            except Exception:
                log.exception("heartbeat failed")
            self._end.wait(MIN_PROGRESS_WRITE_S)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_: type[BaseException] | BaseException | TracebackType | None) -> None:
        self._end.set()  # a thread that hangs in a connection is a daemon
        self._news.set()
