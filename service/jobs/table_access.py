"""The session and the clock of every class that works on the tables of jobs."""

from collections.abc import Callable

from sqlalchemy import Engine
from sqlalchemy.orm import sessionmaker

from service.jobs.clock import clock_of


class TableAccess:
    """Base of the stores. Safe to share between threads; rows they return are detached copies."""

    def __init__(self, engine: Engine, clock_ms: Callable[[], int] | None = None) -> None:
        self._session = sessionmaker(engine, expire_on_commit=False)
        self._clock_ms = clock_ms or clock_of(engine)

    def now_ms(self) -> int:
        """Time of the clock that all processes of the database share, ms since 1970."""
        return self._clock_ms()
