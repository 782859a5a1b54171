"""What is away for a while. A database or a store of files that restarts, or a disk that is full until somebody makes room,
must cost nobody a job: a worker waits for it, the API says `not_ready`.
"""

import errno
import time
from collections.abc import Callable
from typing import TypeVar

import structlog
from obstore.exceptions import BaseError as StoreError
from sqlalchemy.exc import InterfaceError, OperationalError
from sqlalchemy.exc import TimeoutError as PoolTimeout

PATIENCE_S = 600.0
PAUSE_S = 1.0
DATABASE_AWAY = (OperationalError, InterfaceError, PoolTimeout)
NO_ROOM = (errno.ENOSPC, errno.EDQUOT)
Made = TypeVar("Made")
log = structlog.get_logger()


def what_is_away(error: BaseException) -> str | None:
    """In words for clients, what has to come back before this error is gone; None when waiting would not help."""
    if isinstance(error, DATABASE_AWAY):
        return "the database does not answer"
    if isinstance(error, FileNotFoundError | PermissionError):
        return None
    if isinstance(error, OSError) and error.errno in NO_ROOM:
        return "no room is left on the disk"
    # What obstore raises while it streams is an OSError without a number.
    if isinstance(error, StoreError) or (isinstance(error, OSError) and error.errno in (None, errno.EIO)):
        return (
            "no room is left on the disk"
            if "No space left" in str(error)
            else "the store of files does not answer"
        )
    return None


def patiently(act: Callable[[], Made], *, is_worth_it: Callable[[], bool]) -> Made:
    """What `act` returns, again and again while something is away; raises that error after PATIENCE_S, or once it is not
    worth it any more. So `act` may be done twice: its first answer may have been lost on the way."""
    deadline = time.monotonic() + PATIENCE_S
    while True:
        try:
            return act()
        except Exception as error:
            away = what_is_away(error)
            if away is None or time.monotonic() > deadline or not is_worth_it():
                raise
            log.warning("waits for what is away", away=away, reason=str(error).splitlines()[0][:300])
            time.sleep(PAUSE_S)
