"""How long a page of a list of 100,000 jobs takes, by what it is filtered by, on both databases.

.venv/bin/python -m tests.accuracy.job_lists [jobs]
"""

import statistics
import sys
import tempfile
import time
from collections.abc import Mapping
from pathlib import Path

import sqlalchemy as sa
from sqlalchemy import Engine, text

from service.contract.schemas import Status
from service.jobs.models import JobRow, new_id
from service.jobs.store import JobStore
from service.settings import ServiceSettings
from service.storage.database import migrate, open_database
from tests.support.storage import running_postgres

JOBS, REPEATS, PAGE = 100_000, 20, 50
#: What a list is filtered by. Of the jobs 85 % are `ok`; one in 20 fails; a serial number has two jobs.
FILTERS: tuple[dict[str, str], ...] = (
    {"serial": "A-777"},
    {"serial": "A-777", "decision": "fail", "verdict": "ok"},
    {"decision": "fail"},
    {"decision": "fail", "verdict": "ok"},
    {"decision": "fail", "verdict": "no_match"},
    {"verdict": "uncertain"},
    {"batch": "B-7", "decision": "fail"},
    {"part_number": "P-3", "decision": "fail"},
)


def fill(engine: Engine, jobs: int, tenant: str = "default") -> None:
    """Successful jobs of one tenant, one in a hundred failed."""
    rows = [
        {
            "id": new_id(),
            "tenant": tenant,
            "type": "registration",
            "status": Status.FAILED if number % 100 == 99 else Status.SUCCESSFUL,
            "progress": 100.0,
            "inputs": {"design": {"blob": f"sha256:{7:064x}", "filename": "d.stl"}},
            "options": {"tolerance_mm": 0.2, "reference": {"serial": f"A-{number // 2}"}},
            "attempt": 1,
            "turn": 0,
            "has_ticket": False,
            "crashes": 0,
            "created_ms": 1_790_000_000_000 + number,
            "verdict": "ok" if number % 20 < 17 else "uncertain" if number % 20 < 19 else "no_match",
            "decision": "fail" if number % 20 == 3 else "pass" if number % 20 < 17 else "not_judged",
            "serial": f"A-{number // 2}",
            "batch": f"B-{number % 200}",
            "part_number": f"P-{number % 10}",
            "result_bytes": 0,
        }
        for number in range(jobs)
    ]
    table = sa.inspect(JobRow).local_table
    with engine.begin() as connection:
        connection.execute(sa.insert(table), rows)


def plan(engine: Engine, filters: Mapping[str, str]) -> str:
    """How the database finds a page."""
    explain = "EXPLAIN QUERY PLAN " if engine.dialect.name == "sqlite" else "EXPLAIN "
    found: list[str] = []

    def before(_: object, __: object, statement: str, parameters: object, *more: object) -> None:
        if statement.startswith("SELECT") and "FROM jobs" in statement and not found:
            found.append("")
            with engine.connect() as other:
                lines = other.exec_driver_sql(explain + statement, parameters).all()  # type: ignore[call-overload]
            found[0] = "\n".join(str(line[-1]) for line in lines) + "\n"

    sa.event.listen(engine, "before_cursor_execute", before)
    try:
        JobStore(engine).page(equal=filters, limit=PAGE)
    finally:
        sa.event.remove(engine, "before_cursor_execute", before)
    return found[0]


def milliseconds(engine: Engine, filters: Mapping[str, str]) -> tuple[float, int]:
    """Median time of a page, and how many jobs it has."""
    store, times, rows = JobStore(engine), [], 0
    for _ in range(REPEATS):
        start = time.perf_counter()
        rows = len(store.page(equal=filters, limit=PAGE)[0])
        times.append(1000 * (time.perf_counter() - start))
    return statistics.median(times), rows


def main() -> None:
    jobs = int(sys.argv[1]) if len(sys.argv) > 1 else JOBS
    print(f"a page of {PAGE} of {jobs} jobs, median of {REPEATS}, ms\n")
    print("| filter | jobs on the page | SQLite | PostgreSQL |\n|---|---|---|---|")
    with tempfile.TemporaryDirectory() as folder, running_postgres() as postgres:
        urls = [
            ServiceSettings(data_dir=Path(folder)).database,
            ServiceSettings.model_validate({"database_url": postgres.create("lists")}).database,
        ]
        engines = []
        for url in urls:
            migrate(url)
            engines.append(open_database(url))
            fill(engines[-1], jobs)
            with engines[-1].begin() as connection:
                connection.execute(text("ANALYZE"))
        for filters in FILTERS:
            measured = [milliseconds(engine, filters) for engine in engines]
            words = ", ".join(f"{key}={value}" for key, value in filters.items())
            print(f"| {words} | {measured[0][1]} | {measured[0][0]:.1f} | {measured[1][0]:.1f} |", flush=True)
        for engine in engines:
            engine.dispose()


if __name__ == "__main__":
    main()
