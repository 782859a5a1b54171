"""A hundred jobs while a worker, the API or everything is killed with -9 at random moments: `python -m
tests.endurance.chaos`

On SQLite and files it is `cusp up`; on PostgreSQL and S3 an API and two workers. The kills come from a thread
of their own, so that requests are cut in flight. Every job is sent with an `Idempotency-Key` and sent again
until an answer came, as a careful client does. After the last kill the rest is done in peace. At the end: one
job a key, each final, each with the results of one attempt, every file with the digest that its list tells,
and a trigger in the database has counted how often each became final. A job that three workers died of has
failed, with that as its reason.
"""

import argparse
import hashlib
import json
import random
import tempfile
import threading
import time
from abc import ABC, abstractmethod
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import Any

import httpx
import psutil
from rich.console import Console
from rich.table import Table
from sqlalchemy import Engine, text

from service.client.sync import Client
from service.settings import ServiceSettings
from service.storage.database import open_database
from tests.support.meshes import blob_stl
from tests.support.running import QUICK, RunningService, ScaledService
from tests.support.storage import S3, Postgres, running_postgres, running_s3

PAUSE_S = (3.0, 10.0)  # between two kills
PACE_S = 0.2  # between two requests, on average
GIVE_UP_S = 1200
AUDIT = {
    "sqlite": [
        "CREATE TABLE audit (id TEXT, status TEXT)",
        "CREATE TRIGGER note AFTER UPDATE OF status ON jobs "
        "WHEN NEW.status IN ('successful', 'failed', 'dismissed') "
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


class Victim(ABC):
    """A service that can be killed in part or whole, and comes back."""

    @property
    @abstractmethod
    def client(self) -> Client: ...

    @abstractmethod
    def kill(self, what: str, draw: random.Random) -> None:
        """`worker`, `api` or `everything`; returns when what nobody else starts again was started."""

    @abstractmethod
    def stop(self) -> None: ...


class Embedded(Victim):
    """`cusp up`, which starts its parts again itself."""

    def __init__(self, data_dir: Path) -> None:
        self._data_dir = data_dir
        self.database = ServiceSettings(data_dir=data_dir).database
        self._running = self._start()

    def _start(self) -> RunningService:
        return RunningService(self._data_dir, CUSP_JOBS="2", CUSP_LOG_LEVEL="warning")

    @property
    def client(self) -> Client:
        return self._running.client

    def kill(self, what: str, draw: random.Random) -> None:
        if what == "everything":
            self._running.kill_everything()
            self._running = self._start()
        else:
            with suppress(psutil.NoSuchProcess):
                self._running.part(what).kill()

    def stop(self) -> None:
        self._running.stop()


class Scaled(Victim):
    """An API and two workers; a part that is killed is started again, as an orchestrator would."""

    def __init__(self, folder: Path, server: Postgres, s3: S3) -> None:
        self._scaled = ScaledService(folder, server, s3, 2, CUSP_LOG_LEVEL="warning")
        self.database = ServiceSettings.model_validate(
            {"database_url": self._scaled.environment["CUSP_DATABASE_URL"]}
        ).database

    @property
    def client(self) -> Client:
        return self._scaled.client

    def kill(self, what: str, draw: random.Random) -> None:
        service = self._scaled
        numbers = range(len(service.workers))
        workers = (
            [draw.choice(numbers)] if what == "worker" else list(numbers) if what == "everything" else []
        )
        victims = [service.workers[number] for number in workers] + (
            [service.api] if what != "worker" else []
        )
        for victim in victims:
            victim.kill()
        for victim in victims:
            victim.wait()
        for number in workers:
            service.workers[number] = service.start("worker", f"worker-{number}")
        if what != "worker":
            service.api = service.start("api", "api")

    def stop(self) -> None:
        self._scaled.stop()


class Killer:
    """Kills, from a thread of its own, until it was often enough or `stop`."""

    def __init__(self, victim: Victim, seed: int, kills: int) -> None:
        self._victim, self._draw, self._left = victim, random.Random(seed), kills
        self.kills: dict[str, int] = {"worker": 0, "api": 0, "everything": 0}
        self._end = threading.Event()
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def _run(self) -> None:
        while self._left > 0 and not self._end.wait(self._draw.uniform(*PAUSE_S)):
            what = self._draw.choice(list(self.kills))
            self.kills[what] += 1
            self._left -= 1
            self._victim.kill(what, self._draw)

    @property
    def is_busy(self) -> bool:
        """True while there are kills to come."""
        return self._thread.is_alive()

    def stop(self) -> None:
        """No more; raises nothing of what went wrong in the thread: the service would not come back, and that
        is seen.
        """
        self._end.set()
        self._thread.join()


class Orders:
    """What a careful client sends: each order under a key of its own, again until an answer came, and some
    once more later.
    """

    def __init__(self, victim: Victim, design: bytes, scan: bytes) -> None:
        self._victim = victim
        self._files = {"design": ("d.stl", design), "scan": ("s.stl", scan)}
        self.known: dict[str, str] = {}
        self.cut = 0  # requests without an answer
        self.changed = 0  # orders that were answered with another job than before

    def send(self, key: str) -> bool:
        """False when no answer came, or that of a service that is not ready."""
        try:
            answer = httpx.post(
                f"{self._victim.client.server}/v1/jobs",
                files=self._files,
                data={"options": json.dumps({**QUICK, "label": key})},
                headers={"Idempotency-Key": key},
                timeout=20,
            )
        except httpx.TransportError:
            self.cut += 1
            return False
        assert answer.status_code in (202, 503), answer.text
        if answer.status_code == 202:
            self.changed += self.known.setdefault(key, answer.json()["id"]) != answer.json()["id"]
        return answer.status_code == 202


def is_whole(client: Client, job_id: str, folder: Path) -> bool:
    """True when every file of the job is there, with its size and its digest."""
    for file in client.files(job_id):
        content = client.download(job_id, file.name, folder / file.name).read_bytes()
        if len(content) != file.size or hashlib.sha256(content).hexdigest() != file.sha256:
            return False
    return True


def final_ids(engine: Engine) -> set[str]:
    query = "SELECT id FROM jobs WHERE status IN ('successful', 'failed', 'dismissed')"
    with engine.connect() as connection:
        return set(connection.scalars(text(query)))


def run(kind: str, jobs: int, seed: int, kills: int) -> dict[str, Any]:
    """One service of a kind of storage, killed until all its jobs are done."""
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        if kind == "postgresql":
            server, s3 = stack.enter_context(running_postgres()), stack.enter_context(running_s3())
            victim: Embedded | Scaled = Scaled(folder, server, s3)
        else:
            victim = Embedded(folder / "data")
        stack.callback(lambda: victim.stop())
        engine = open_database(victim.database)
        stack.callback(engine.dispose)
        with engine.begin() as connection:
            for statement in AUDIT[kind]:
                connection.execute(text(statement))
        begun = time.monotonic()
        killer = Killer(victim, seed, kills)
        stack.callback(killer.stop)  # before the service is stopped
        orders = Orders(victim, blob_stl(), blob_stl(23, 37, turn_deg=25.0, shift_mm=(4, -3, 2)))
        draw = random.Random(seed + 1)
        for number in range(jobs):
            while not orders.send(f"order-{number}"):
                time.sleep(0.05)
            time.sleep(draw.uniform(0.0, 2.0 * PACE_S))
        while (len(final_ids(engine)) < jobs or killer.is_busy) and time.monotonic() - begun < GIVE_UP_S:
            orders.send(draw.choice(list(orders.known)))
            time.sleep(draw.uniform(0.0, 2.0 * PACE_S))
        seconds = time.monotonic() - begun
        killer.stop()
        while not victim.client.is_ready():
            time.sleep(0.1)
        with engine.connect() as connection:
            rows = connection.execute(text("SELECT id, status, attempt, published_attempt FROM jobs")).all()
            audit = connection.execute(text("SELECT id, count(*) FROM audit GROUP BY id")).all()
        whole = sum(is_whole(victim.client, row.id, folder) for row in rows if row.status == "successful")
        return {
            "storage": kind,
            "jobs": jobs,
            **{f"kills of {what}": count for what, count in killer.kills.items()},
            "requests cut": orders.cut,
            "lost": len(set(orders.known.values()) - final_ids(engine)),
            "twice": len(rows) - jobs + orders.changed + sum(count > 1 for _, count in audit),
            "successful": sum(row.status == "successful" for row in rows),
            "every file with its digest": whole,
            "failed": sum(row.status == "failed" for row in rows),
            "run again": sum(row.attempt > 1 for row in rows),
            "seconds": round(seconds),
        }


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--jobs", type=int, default=100)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--kills", type=int, default=20, help="at most so many")
    parser.add_argument("--storage", choices=["sqlite", "postgresql", "both"], default="both")
    options = parser.parse_args()
    kinds = ["sqlite", "postgresql"] if options.storage == "both" else [options.storage]
    found = [run(kind, options.jobs, options.seed, options.kills) for kind in kinds]
    table = Table("what", *(each["storage"] for each in found), title="Killed with -9 at random moments")
    for what in found[0]:
        table.add_row(what, *(str(each[what]) for each in found))
    Console().print(table)
    if any(
        each["lost"] or each["twice"] or each["every file with its digest"] != each["successful"]
        for each in found
    ):
        raise SystemExit("jobs were lost, or done twice, or their files are not what they were")


if __name__ == "__main__":
    main()
