"""All processes of a database share a clock, however the clocks of their machines are set."""

import pytest
from sqlalchemy import text

from service.jobs.clock import RENEW_MS, ServerClock, clock_of, since_boot_ms
from service.jobs.models import now_ms
from service.jobs.store import JobStore
from service.storage.database import open_database
from tests.support.service import Service

pytestmark = pytest.mark.storages
APART_MS = 60_000


def test_a_worker_whose_clock_is_a_minute_ahead_takes_no_job_for_lost(service: Service) -> None:
    """Its own clock, on PostgreSQL, is not asked: it sees the heartbeat of the other as new."""
    engine = open_database(service.settings.database)
    if engine.dialect.name == "postgresql":
        ahead = JobStore(engine, ServerClock(engine, lambda: since_boot_ms() + APART_MS))
        job_id = service.submitted()
        service.jobs.claim(job_id, "worker-1")
        assert ahead.orphans(silent_since_ms=ahead.now_ms() - APART_MS // 4) == []
        assert abs(ahead.now_ms() - service.jobs.now_ms()) < APART_MS // 4
    else:
        assert clock_of(engine) is now_ms
    engine.dispose()


def test_the_server_is_asked_once_a_minute_and_may_be_away_then(service: Service) -> None:
    engine = open_database(service.settings.database)
    if engine.dialect.name == "postgresql":
        boot = [1_000_000]
        clock = ServerClock(engine, lambda: boot[0])
        first = clock()
        with engine.connect() as connection:
            server_ms = connection.scalar(text("SELECT extract(epoch FROM clock_timestamp()) * 1000"))
        assert abs(first - float(server_ms)) < APART_MS // 4
        boot[0] += RENEW_MS - 1
        assert clock() == first + RENEW_MS - 1  # counted, not asked
        away = open_database("postgresql+psycopg://none@127.0.0.1:1/none")
        clock._engine = away
        boot[0] += 2
        assert clock() == first + RENEW_MS + 1  # asked in vain: counted on
        away.dispose()
    engine.dispose()
