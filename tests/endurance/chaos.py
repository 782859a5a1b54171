"""A hundred jobs while the worker, the API or everything is killed with -9 at random moments: `python -m tests.endurance.chaos`

Every job is sent with an `Idempotency-Key` and sent again until an answer came, as a careful client does. After the last kill
the rest is done in peace. At the end: one job a key, each final, each with the results of one attempt, and a trigger in the
database has counted how often each became final. A job that three workers died of has failed, with that as its reason.
"""

import argparse
import json
import random
import tempfile
import time
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import Any

import httpx
import psutil
from rich.console import Console
from rich.table import Table
from sqlalchemy import Engine, text

from service.settings import ServiceSettings
from service.store import migrate, open_database
from tests.e2e.running import QUICK, RunningService
from tests.service.meshes import blob_stl
from tests.storage import running_postgres, running_s3

PAUSE_S = (3.0, 10.0)  # between two kills
KILLS = 20
GIVE_UP_S = 1200
AUDIT = {
    "sqlite": [
        "CREATE TABLE audit (id TEXT, status TEXT)",
        "CREATE TRIGGER note AFTER UPDATE OF status ON jobs WHEN NEW.status IN ('successful', 'failed', 'dismissed') "
        "BEGIN INSERT INTO audit VALUES (NEW.id, NEW.status); END",
    ],
    "postgresql": [
        "CREATE TABLE audit (id TEXT, status TEXT)",
        "CREATE FUNCTION note() RETURNS trigger LANGUAGE plpgsql AS "
        "$$ BEGIN INSERT INTO audit VALUES (NEW.id, NEW.status); RETURN NEW; END $$",
        "CREATE TRIGGER note AFTER UPDATE OF status ON jobs FOR EACH ROW "
        "WHEN (NEW.status IN ('successful', 'failed', 'dismissed')) EXECUTE FUNCTION note()",
    ],
}


def submit_all(service: "Killed", jobs: int, design: bytes, scan: bytes) -> dict[str, str]:
    """Key -> job id; sent again until an answer came."""
    known: dict[str, str] = {}
    for number in range(jobs):
        key = f"order-{number}"
        while key not in known:
            with suppress(httpx.TransportError):
                answer = httpx.post(
                    f"{service.address}/v1/jobs",
                    files={"design": ("d.stl", design), "scan": ("s.stl", scan)},
                    data={"options": json.dumps({**QUICK, "label": key})},
                    headers={"Idempotency-Key": key},
                    timeout=20,
                )
                if answer.status_code == 202:
                    known[key] = answer.json()["id"]
            service.maybe_kill()
    return known


class Killed:
    """A service that is killed, part by part or whole, and started again."""

    def __init__(self, data_dir: Path, environment: dict[str, str], seed: int) -> None:
        self._make = lambda: RunningService(data_dir, CUSP_JOBS="2", CUSP_LOG_LEVEL="warning", **environment)
        self._random = random.Random(seed)
        self.running = self._make()
        self.kills: dict[str, int] = {"worker": 0, "api": 0, "everything": 0}
        self._next = time.monotonic() + self._random.uniform(*PAUSE_S)

    @property
    def address(self) -> str:
        return self.running.client.server

    def maybe_kill(self) -> None:
        """When it is time: one of the three."""
        if time.monotonic() < self._next or sum(self.kills.values()) >= KILLS:
            return
        what = self._random.choice(list(self.kills))
        self.kills[what] += 1
        if what == "everything":
            self.running.kill_everything()
            self.running = self._make()
        else:
            with suppress(psutil.NoSuchProcess):
                self.running.part(what).kill()
        self._next = time.monotonic() + self._random.uniform(*PAUSE_S)


def final_ids(engine: Engine) -> set[str]:
    query = "SELECT id FROM jobs WHERE status IN ('successful', 'failed', 'dismissed')"
    with engine.connect() as connection:
        return set(connection.scalars(text(query)))


def run(kind: str, jobs: int, seed: int) -> dict[str, Any]:
    """One service of a kind of storage, killed until all its jobs are done."""
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        environment: dict[str, str] = {}
        if kind == "postgresql":
            server, s3 = stack.enter_context(running_postgres()), stack.enter_context(running_s3())
            environment = {
                **s3.environment,
                "CUSP_DATABASE_URL": server.create("chaos"),
                "CUSP_BLOB_URL": f"s3://{s3.bucket}/chaos",
                "CUSP_WORKER_ID": "worker-1",
            }
        settings = ServiceSettings.model_validate(
            {"data_dir": folder / "data", "database_url": environment.get("CUSP_DATABASE_URL", "")}
        )
        settings.make_folders()
        migrate(settings.database)
        engine = open_database(settings.database)
        stack.callback(engine.dispose)
        with engine.begin() as connection:
            for statement in AUDIT[kind]:
                connection.execute(text(statement))
        begun = time.monotonic()
        service = Killed(settings.data_dir, environment, seed)
        stack.callback(lambda: service.running.stop())
        known = submit_all(service, jobs, blob_stl(), blob_stl(23, 37, turn_deg=25.0, shift_mm=(4, -3, 2)))
        while len(final_ids(engine)) < jobs and time.monotonic() - begun < GIVE_UP_S:
            time.sleep(0.1)
            service.maybe_kill()
        seconds = time.monotonic() - begun
        with engine.connect() as connection:
            rows = connection.execute(text("SELECT id, status, attempt, published_attempt FROM jobs")).all()
            audit = connection.execute(text("SELECT id, count(*) FROM audit GROUP BY id")).all()
        while not service.running.client.is_ready():
            time.sleep(0.1)
        readable = sum(bool(service.running.client.results(row.id)) for row in rows if row.status == "successful")
        return {
            "storage": kind,
            "jobs": jobs,
            **{f"kills of {what}": count for what, count in service.kills.items()},
            "lost": len(set(known.values()) - final_ids(engine)),
            "twice": len(rows) - jobs + sum(count > 1 for _, count in audit),
            "successful": sum(row.status == "successful" for row in rows),
            "readable": readable,
            "failed": sum(row.status == "failed" for row in rows),
            "run again": sum(row.attempt > 1 for row in rows),
            "seconds": round(seconds),
        }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--jobs", type=int, default=100)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--storage", choices=["sqlite", "postgresql", "both"], default="both")
    options = parser.parse_args()
    kinds = ["sqlite", "postgresql"] if options.storage == "both" else [options.storage]
    found = [run(kind, options.jobs, options.seed) for kind in kinds]
    table = Table("what", *(each["storage"] for each in found), title="Killed with -9 at random moments")
    for what in found[0]:
        table.add_row(what, *(str(each[what]) for each in found))
    Console().print(table)
    if any(each["lost"] or each["twice"] or each["readable"] != each["successful"] for each in found):
        raise SystemExit("jobs were lost, or done twice")


if __name__ == "__main__":
    main()
