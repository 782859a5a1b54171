"""The heartbeat of a running job, from its claim to its end: also while meshes are fetched or results are
stored.

Each heartbeat also tells whether the job still belongs to this attempt, or was dismissed or reassigned.
"""

import threading
from collections.abc import Callable
from types import TracebackType
from typing import Self

import structlog

from service.jobs.liveness import JOB_HEARTBEAT_S
from service.storage.retry import DATABASE_UNAVAILABLE

log = structlog.get_logger()


class Heartbeat:
    """beat : writes one heartbeat; False if the job does not belong to this attempt (any more)"""

    def __init__(self, beat: Callable[[], bool]) -> None:
        self._beat = beat
        self._end = threading.Event()
        self._lost = threading.Event()
        self._thread = threading.Thread(target=self._run, name="heartbeat", daemon=True)

    @property
    def is_ours(self) -> bool:
        """False once the database answered that the job does not belong to this attempt."""
        return not self._lost.is_set()

    def _run(self) -> None:
        while not self._end.wait(JOB_HEARTBEAT_S):
            try:
                if not self._beat():
                    self._lost.set()
                    return
            except DATABASE_UNAVAILABLE:
                continue  # asked again when the database is back
            except Exception:
                log.exception("heartbeat failed")

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_: type[BaseException] | BaseException | TracebackType | None) -> None:
        self._end.set()  # a thread that hangs in a connection is a daemon
