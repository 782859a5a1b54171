"""Says that a job is alive, from its claim to its conclusion: also while its meshes are fetched or its results are stored,
which takes as long as a bucket likes. The same answer tells when the job is no longer this attempt's: dismissed, or handed on.
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
    """beat : says so once; False when the job is not ours (any more)"""

    def __init__(self, beat: Callable[[], bool]) -> None:
        self._beat = beat
        self._end = threading.Event()
        self._lost = threading.Event()
        self._thread = threading.Thread(target=self._run, name="heartbeat", daemon=True)

    @property
    def is_ours(self) -> bool:
        """False once the database said that the job is not this attempt's any more."""
        return not self._lost.is_set()

    def _run(self) -> None:
        while not self._end.wait(JOB_HEARTBEAT_S):
            try:
                if not self._beat():
                    self._lost.set()
                    return
            except DATABASE_UNAVAILABLE:
                continue  # whose the job is will be asked when the database is back
            except Exception:
                log.exception("heartbeat failed")

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_: type[BaseException] | BaseException | TracebackType | None) -> None:
        self._end.set()  # one that hangs in a connection ends by itself: its job is not running any more
