"""A thousand small jobs while what they need fails at random moments: `python -m tests.endurance.chaos`

On SQLite and files it is `cusp up`; on PostgreSQL and S3 an API and two workers, of which one has a clock
that is a minute ahead. A worker, the API or everything is killed with -9, a worker is paused for longer
than others wait for it, the disk is full, the database restarts, the store answers 503 for a minute; each
in turn, from a thread of its own, so that requests are cut in flight. Every job is sent with an
`Idempotency-Key` and sent again until an answer came, as a careful client does. After the last fault the
rest is done in peace. At the end: one job a key, each final, each with the results of one attempt, every
file with the digest that its list tells, and a trigger in the database has counted how often each became
final. A job that three workers died of has failed, with that as its reason.
"""

import argparse
import hashlib
import json
import os
import random
import subprocess
import tempfile
import threading
import time
from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import httpx
import psutil
from rich.console import Console
from rich.table import Table
from sqlalchemy import Engine, text
from sqlalchemy.exc import OperationalError

from service.client.sync import Client
from service.settings import ServiceSettings
from service.storage.database import open_database
from tests.endurance.load_jobs import SMALLEST, put, small_mesh
from tests.support.outages import Switch, clock_ahead, full_disk
from tests.support.running import RunningService, ScaledService
from tests.support.storage import S3, Postgres, running_postgres, running_s3

PAUSE_S = (3.0, 10.0)  # between two faults
PACE_S = 0.05  # between two requests, on average
GIVE_UP_S = 7200
PAUSED_S = 20.0  # of a worker; the others wait for 15 s
DISK_FULL_S = 10.0
DATABASE_AWAY_S = 3.0
STORE_AWAY_S = 60.0
CLOCK_AHEAD_S = 60
DISK_MIB = 512  # of the file system that gets full
FORM_EVERY = 10  # so many jobs bring their mesh themselves; the others name one that was sent before
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
    """A service that fails in part or whole, and comes back."""

    #: What can happen to it: `strike` knows these words.
    faults: tuple[str, ...]

    @property
    @abstractmethod
    def client(self) -> Client: ...

    @abstractmethod
    def strike(self, what: str, draw: random.Random) -> None:
        """Returns when the fault is over, and what nobody else starts again was started."""

    @abstractmethod
    def stop(self) -> None: ...


class Embedded(Victim):
    """`cusp up`, which starts its parts again itself."""

    faults = ("kill worker", "kill api", "kill everything", "pause worker", "disk full")

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self.database = ServiceSettings(data_dir=folder / "data").database
        self._running = self._start()

    def _start(self) -> RunningService:
        return RunningService(
            self._folder / "data", CUSP_JOBS="2", CUSP_LOG_LEVEL="warning", CUSP_MIN_FREE_DISK_MIB="16"
        )

    @property
    def client(self) -> Client:
        return self._running.client

    def strike(self, what: str, draw: random.Random) -> None:
        if what == "kill everything":
            self._running.kill_everything()
            self._running = self._start()
        elif what == "disk full":
            with full_disk(self._folder):
                time.sleep(DISK_FULL_S)
        else:
            act, part = what.split()
            with suppress(psutil.NoSuchProcess):
                process = self._running.part(part)
                process.kill() if act == "kill" else pause(process)

    def stop(self) -> None:
        self._running.stop()


class Scaled(Victim):
    """An API and two workers; a part that is killed is started again, as an orchestrator would."""

    faults = ("kill worker", "kill api", "kill everything", "pause worker", "restart database", "store 503")

    def __init__(self, folder: Path, server: Postgres, s3: S3) -> None:
        self._server, self._way = server, Switch(s3.endpoint)
        self._ahead = {"worker-1": clock_ahead(CLOCK_AHEAD_S, folder)}
        self._scaled = ScaledService(
            folder,
            server,
            replace(s3, endpoint=self._way.endpoint),
            2,
            self._ahead,
            CUSP_LOG_LEVEL="warning",
        )
        self.database = ServiceSettings.model_validate(
            {"database_url": self._scaled.environment["CUSP_DATABASE_URL"]}
        ).database

    @property
    def client(self) -> Client:
        return self._scaled.client

    def strike(self, what: str, draw: random.Random) -> None:
        match what:
            case "restart database":
                self._server.stop()
                time.sleep(DATABASE_AWAY_S)
                self._server.start()
            case "store 503":
                self._way.close()
                time.sleep(STORE_AWAY_S)
                self._way.reopen()
            case "pause worker":
                pause(draw.choice(self._scaled.workers))
            case _:
                self._kill(what.removeprefix("kill "), draw)

    def _kill(self, what: str, draw: random.Random) -> None:
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
        self._way.stop()


def pause(process: psutil.Process) -> None:
    """As if its machine slept."""
    process.suspend()
    time.sleep(PAUSED_S)
    process.resume()


class Fate:
    """Strikes, from a thread of its own, until it was often enough or `stop`."""

    def __init__(self, victim: Victim, seed: int, strikes: int) -> None:
        self._victim, self._draw, self._left = victim, random.Random(seed), strikes
        self.strikes: Counter[str] = Counter()
        self._end = threading.Event()
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def _run(self) -> None:
        turns: list[str] = []
        while self._left > 0 and not self._end.wait(self._draw.uniform(*PAUSE_S)):
            turns = turns or self._draw.sample(self._victim.faults, len(self._victim.faults))
            what = turns.pop()
            self.strikes[what] += 1
            self._left -= 1
            self._victim.strike(what, self._draw)

    @property
    def is_busy(self) -> bool:
        """True while there are faults to come."""
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

    def __init__(self, victim: Victim, mesh: bytes) -> None:
        self._victim, self._mesh = victim, mesh
        with httpx.Client(base_url=victim.client.server, timeout=60) as client:
            self._blob = put(client, mesh, "s.stl")
        self.known: dict[str, str] = {}
        self.cut = 0  # requests without an answer
        self.refused = 0  # answers that something is away for now
        self.changed = 0  # orders that were answered with another job than before

    def send(self, number: int) -> bool:
        """False when no answer came, or that of a service that is not ready."""
        key = f"order-{number}"
        options = {**SMALLEST, "label": key}
        body: dict[str, Any] = {"json": {"type": "landmarks", "mesh": self._blob, "options": options}}
        if number % FORM_EVERY == 0:
            data = {"type": "landmarks", "options": json.dumps(options)}
            body = {"files": {"mesh": ("s.stl", self._mesh)}, "data": data}
        try:
            answer = httpx.post(
                f"{self._victim.client.server}/v1/jobs",
                **body,
                headers={"Idempotency-Key": key},
                timeout=20,
            )
        except httpx.TransportError:
            self.cut += 1
            return False
        assert answer.status_code in (202, 503, 507), answer.text
        if answer.status_code != 202:
            self.refused += 1
            return False
        self.changed += self.known.setdefault(key, answer.json()["id"]) != answer.json()["id"]
        return True


def is_whole(client: Client, job_id: str, folder: Path) -> bool:
    """True when every file of the job is there, with its size and its digest."""
    for file in client.files(job_id):
        content = client.download(job_id, file.name, folder / file.name).read_bytes()
        if len(content) != file.size or hashlib.sha256(content).hexdigest() != file.sha256:
            return False
    return True


def code_of(row: Any) -> str:
    """The code of the error of a job; empty without one. SQLite returns JSON as text."""
    error = json.loads(row.error) if isinstance(row.error, str) else row.error
    return str(error["code"]) if error else ""


def final_ids(engine: Engine) -> set[str]:
    """Empty while the database is away."""
    query = "SELECT id FROM jobs WHERE status IN ('successful', 'failed', 'dismissed')"
    try:
        with engine.connect() as connection:
            return set(connection.scalars(text(query)))
    except OperationalError:
        return set()


def run(kind: str, jobs: int, seed: int, faults: int, keep_logs: Path | None) -> dict[str, Any]:
    """One service of a kind of storage, struck until all its jobs are done. keep_logs : folder for its log"""
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        if kind == "postgresql":
            server, s3 = stack.enter_context(running_postgres()), stack.enter_context(running_s3())
            victim: Embedded | Scaled = Scaled(folder, server, s3)
        else:
            victim = Embedded(stack.enter_context(small_disk(folder)))
        stack.callback(lambda: victim.stop())
        engine = open_database(victim.database)
        stack.callback(engine.dispose)
        with engine.begin() as connection:
            for statement in AUDIT[kind]:
                connection.execute(text(statement))
        begun = time.monotonic()
        orders = Orders(victim, small_mesh(1))
        fate = Fate(victim, seed, faults)
        stack.callback(fate.stop)  # before the service is stopped
        draw = random.Random(seed + 1)
        for number in range(jobs):
            while not orders.send(number):
                time.sleep(0.2)
            time.sleep(draw.uniform(0.0, 2.0 * PACE_S))
        while (len(final_ids(engine)) < jobs or fate.is_busy) and time.monotonic() - begun < GIVE_UP_S:
            orders.send(draw.randrange(jobs))
            time.sleep(0.5)
        seconds = time.monotonic() - begun
        fate.stop()
        while not victim.client.is_ready():
            time.sleep(0.1)
        with engine.connect() as connection:
            rows = connection.execute(text("SELECT id, status, attempt, error FROM jobs")).all()
            audit = connection.execute(text("SELECT id, count(*) FROM audit GROUP BY id")).all()
        if keep_logs is not None:
            keep_logs.mkdir(parents=True, exist_ok=True)
            log = folder / ("log" if kind == "postgresql" else "data.log")
            (keep_logs / f"{kind}.log").write_bytes(log.read_bytes())
        whole = sum(is_whole(victim.client, row.id, folder) for row in rows if row.status == "successful")
        return {
            "storage": kind,
            "jobs": jobs,
            **dict(sorted(fate.strikes.items())),
            "requests cut": orders.cut,
            "requests refused for now": orders.refused,
            "lost": len(set(orders.known.values()) - final_ids(engine)),
            "twice": len(rows) - jobs + orders.changed + sum(count > 1 for _, count in audit),
            "left running": sum(row.status in ("accepted", "running") for row in rows),
            "successful": sum(row.status == "successful" for row in rows),
            "every file with its digest": whole,
            "failed": sum(row.status == "failed" for row in rows),
            **{
                f"failed: {code}": count
                for code, count in sorted(Counter(map(code_of, rows)).items())
                if code
            },
            "run again": sum(row.attempt > 1 for row in rows),
            "seconds": round(seconds),
            "load of the machine": round(os.getloadavg()[0], 1),
        }


@contextmanager
def small_disk(folder: Path) -> Iterator[Path]:
    """A file system of its own, in memory, that can be filled. Needs root."""
    subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={DISK_MIB}m,mode=700", "tmpfs", folder], check=True)
    try:
        yield folder
    finally:
        subprocess.run(["umount", "--lazy", folder], check=False)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--jobs", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--faults", type=int, default=18, help="at most so many")
    parser.add_argument("--storage", choices=["sqlite", "postgresql", "both"], default="both")
    parser.add_argument("--keep-logs", type=Path, help="folder for what the services wrote")
    options = parser.parse_args()
    kinds = ["sqlite", "postgresql"] if options.storage == "both" else [options.storage]
    found = [run(kind, options.jobs, options.seed, options.faults, options.keep_logs) for kind in kinds]
    table = Table("what", *(each["storage"] for each in found), title="Faults at random moments")
    for what in dict.fromkeys(what for each in found for what in each):
        table.add_row(what, *(str(each.get(what, "-")) for each in found))
    Console().print(table)
    if any(
        each["lost"]
        or each["twice"]
        or each["left running"]
        or each["every file with its digest"] != each["successful"]
        for each in found
    ):
        raise SystemExit("jobs were lost, done twice or left, or their files are not what they were")


if __name__ == "__main__":
    main()
