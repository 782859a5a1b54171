"""Retries for what is unavailable for a while: a database or an object store that restarts, a disk that is
full, a machine without room for another thread or open file.

No job fails for it. A worker waits until the dependency is back; the API answers `not_ready`.
"""

import errno
from collections.abc import Callable
from typing import TypeVar

import structlog
from obstore.exceptions import BaseError as StoreError
from sqlalchemy.exc import InterfaceError, OperationalError
from sqlalchemy.exc import TimeoutError as PoolTimeout
from tenacity import RetryCallState, Retrying, retry_if_exception, stop_after_delay, wait_fixed

RETRY_LIMIT_S = 600.0
PAUSE_S = 1.0
DATABASE_UNAVAILABLE = (OperationalError, InterfaceError, PoolTimeout)
DISK_FULL = (errno.ENOSPC, errno.EDQUOT)
NO_ROOM = (errno.EAGAIN, errno.EMFILE, errno.ENFILE, errno.ENOMEM)
NO_THREAD = "can't start new thread"  # how CPython's RuntimeError begins
Returned = TypeVar("Returned")
log = structlog.get_logger()


def unavailable_dependency(error: BaseException) -> str | None:
    """The dependency that has to come back, in words for clients; None if a retry would not help."""
    if isinstance(error, DATABASE_UNAVAILABLE):
        return "the database does not answer"
    if isinstance(error, FileNotFoundError | PermissionError):
        return None
    if isinstance(error, OSError) and error.errno in DISK_FULL:
        return "no room is left on the disk"
    if isinstance(error, MemoryError) or (isinstance(error, OSError) and error.errno in NO_ROOM):
        return "the machine has no room for another process, open file or allocation"
    if isinstance(error, RuntimeError) and str(error).startswith(NO_THREAD):
        return "the machine has no room for another thread"
    # While it streams, obstore raises an OSError without an error number.
    if isinstance(error, StoreError) or (isinstance(error, OSError) and error.errno in (None, errno.EIO)):
        return (
            "no room is left on the disk"
            if "No space left" in str(error)
            else "the store of files does not answer"
        )
    return None


def retry_transient(call: Callable[[], Returned], *, is_wanted: Callable[[], bool]) -> Returned:
    """Repeat `call` while a dependency is unavailable, and return what it returns.

    Raises the last error after RETRY_LIMIT_S, or as soon as `is_wanted()` is false. `call` must be
    idempotent: it may have succeeded although its answer was lost.
    """

    def should_retry(error: BaseException) -> bool:
        return unavailable_dependency(error) is not None and is_wanted()

    retrying = Retrying(
        retry=retry_if_exception(should_retry),
        stop=stop_after_delay(RETRY_LIMIT_S),
        wait=wait_fixed(PAUSE_S),
        before_sleep=_log_retry,
        reraise=True,
    )
    return retrying(call)


def _log_retry(state: RetryCallState) -> None:
    error = None if state.outcome is None else state.outcome.exception()
    if error is not None:
        reason = (str(error) or type(error).__name__).splitlines()[0][:300]
        log.warning(
            "retry: a dependency is unavailable", unavailable=unavailable_dependency(error), reason=reason
        )
