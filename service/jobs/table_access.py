"""The session and the clock of every class that works on the tables of jobs."""

from collections.abc import Callable

from sqlalchemy import Engine
from sqlalchemy.orm import sessionmaker

from service.jobs.models import now_ms


class TableAccess:
    """Base of the stores. Safe to share between threads; rows they return are detached copies."""

    def __init__(self, engine: Engine, clock_ms: Callable[[], int] = now_ms) -> None:
        self._session = sessionmaker(engine, expire_on_commit=False)
        self._clock_ms = clock_ms
