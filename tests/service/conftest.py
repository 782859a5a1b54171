"""One service in this process: real tables and blobs in a temporary folder, a queue that only takes notes, and a
worker that runs a job when the test says so."""

import shutil
import threading
import time
import uuid
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import httpx
import pytest
import structlog
import uvicorn
from fastapi import FastAPI
from sqlalchemy import text

from service.api.app import create_app
from service.execution.sandbox import Outcome
from service.execution.worker import Worker
from service.jobs.dispatcher import Dispatcher
from service.jobs.metrics import Metrics
from service.jobs.store import JobStore
from service.settings import ServiceSettings
from service.storage.blobs import BlobStore
from service.storage.database import migrate, open_database
from service.storage.design_cache import DesignCache
from tests.support.storage import Postgres

TRIANGLE_OBJ = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"
RESULTS = b'{"schema_version": "1", "verdict": {"status": "ok"}}'


@dataclass
class NotingQueue:
    """Stands in for DBOS."""

    waiting: list[str] = field(default_factory=list)
    turns: dict[str, int] = field(default_factory=dict)

    def enqueue(self, job_id: str, turn: int) -> None:
        if job_id not in self.waiting:
            self.waiting.append(job_id)
        self.turns[job_id] = turn

    requeue = enqueue

    def drop(self, job_ids: Sequence[str]) -> None:
        self.waiting = [each for each in self.waiting if each not in job_ids]

    def entries(self) -> dict[str, str | None]:
        return dict.fromkeys(self.waiting)


class ScriptedSandbox:
    """Stands in for the child process: `act` is called with the task, and says how it ended."""

    def __init__(self) -> None:
        self.tasks: list[dict[str, Any]] = []
        self.act: Callable[..., Outcome] = self.succeed

    def run(self, key: str, task: dict[str, Any], on_progress: Any, is_wanted: Callable[[], bool]) -> Outcome:
        self.tasks.append(task)
        return self.act(task, on_progress, is_wanted)

    @staticmethod
    def succeed(task: dict[str, Any], on_progress: Any, is_wanted: Callable[[], bool]) -> Outcome:
        on_progress("report", 99.0, "writing")
        out = Path(task["out"])
        out.mkdir()
        (out / "results.json").write_bytes(RESULTS)
        (out / "aligned.ply").write_bytes(b"ply\n")
        return Outcome("done", None, 0.1, 100.0)


@dataclass
class Service:
    """What a test works with."""

    http: httpx.Client
    jobs: JobStore
    blobs: BlobStore
    queue: NotingQueue
    sandbox: ScriptedSandbox
    worker: Worker
    settings: ServiceSettings

    @property
    def waiting(self) -> list[str]:
        """Jobs with a ticket, once the desk has seen to it."""
        Dispatcher(self.jobs, self.queue).dispatch()
        return self.queue.waiting

    def submit(self, options: str = "{}", **files: Any) -> httpx.Response:
        given = {"design": ("d.obj", TRIANGLE_OBJ), "scan": ("s.obj", TRIANGLE_OBJ), **files}
        return self.http.post("/v1/jobs", files=given, data={"options": options})

    def submit_one(self, kind: str, options: str = "{}", **files: Any) -> httpx.Response:
        """A job of a type with one mesh."""
        given = files or {"mesh": ("m.obj", TRIANGLE_OBJ)}
        return self.http.post("/v1/jobs", files=given, data={"type": kind, "options": options})

    def submitted(self, options: str = "{}") -> str:
        answer = self.submit(options)
        assert answer.status_code == 202, answer.text
        return str(answer.json()["id"])

    def finished(self, options: str = "{}") -> str:
        job_id = self.submitted(options)
        self.worker.run(job_id)
        return job_id

    def status(self, job_id: str) -> dict[str, Any]:
        document: dict[str, Any] = self.http.get(f"/v1/jobs/{job_id}").json()
        return document


@pytest.fixture(autouse=True, scope="session")
def _plain_logs() -> None:
    renderer = structlog.dev.ConsoleRenderer(colors=False, exception_formatter=structlog.dev.plain_traceback)
    structlog.configure(processors=[structlog.stdlib.add_log_level, renderer])


@pytest.fixture(scope="session")
def migrated(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An empty database; copying it is faster than migrating for each test."""
    path = tmp_path_factory.mktemp("migrated") / "cusp.db"
    migrate(f"sqlite:///{path}")
    return path


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """Modules that say `pytestmark = pytest.mark.storages` run on both kinds of storage."""
    if "storage" in metafunc.fixturenames and metafunc.definition.get_closest_marker("storages"):
        metafunc.parametrize("storage", ["embedded", "scaled"], indirect=True)


@pytest.fixture
def storage(request: pytest.FixtureRequest, tmp_path: Path, migrated: Path) -> Iterator[dict[str, Any]]:
    """Settings of where things are: SQLite and files, or PostgreSQL and S3; the tables are made."""
    folder = tmp_path / "data"
    if getattr(request, "param", "embedded") == "embedded":
        folder.mkdir(mode=0o700)
        shutil.copy(migrated, folder / "cusp.db")
        yield {"data_dir": folder}
        return
    server, s3 = request.getfixturevalue("postgres"), request.getfixturevalue("s3")
    request.getfixturevalue("postgres_migrated")
    name = f"t_{uuid.uuid4().hex}"
    with pytest.MonkeyPatch.context() as patch:
        for variable, value in s3.environment.items():
            patch.setenv(variable, value)
        yield {
            "data_dir": folder,
            "database_url": server.create(name, template="migrated"),
            "blob_url": f"s3://{s3.bucket}/{name}",
        }
    server.drop(name)


@pytest.fixture(scope="session")
def postgres_migrated(postgres: Postgres) -> None:
    url = ServiceSettings.model_validate({"database_url": postgres.create("migrated")}).database
    migrate(url)


@pytest.fixture
def settings(storage: dict[str, Any]) -> ServiceSettings:
    made = ServiceSettings(**storage, max_upload_mib=1, queue_limit=5)
    made.make_folders()
    return made


@pytest.fixture
def service(settings: ServiceSettings) -> Iterator[Service]:
    engine = open_database(settings.database)
    jobs, blobs, queue, sandbox = (
        JobStore(engine),
        BlobStore(settings.blobs),
        NotingQueue(),
        ScriptedSandbox(),
    )
    designs, metrics = DesignCache(blobs.store, settings.design_cache_mib), Metrics(engine, settings.data_dir)
    worker = Worker("worker-1", jobs, blobs, designs, sandbox, settings.scratch_dir, metrics)  # type: ignore[arg-type]
    with serving(create_app(settings)) as address, httpx.Client(base_url=address, timeout=30) as http:
        yield Service(http, jobs, blobs, queue, sandbox, worker, settings)
    engine.dispose()


def spoil(service: Service, job_id: str, **values: str) -> None:
    """Damage a row by hand, as a later version or a broken disk might."""
    engine = open_database(service.settings.database)
    with engine.begin() as connection:
        for column, value in values.items():
            statement = f"UPDATE jobs SET {column} = :value WHERE id = :id"  # noqa: S608 (our own words)
            connection.execute(text(statement), {"value": value, "id": job_id})
    engine.dispose()


@contextmanager
def serving(app: FastAPI) -> Iterator[str]:
    """A real server in a thread of this process, on a port that the system chose."""
    server = uvicorn.Server(uvicorn.Config(app, port=0, log_config=None, timeout_graceful_shutdown=1))
    thread = threading.Thread(target=server.run)
    thread.start()
    while not server.started:
        assert thread.is_alive(), "the server did not start"
        time.sleep(0.005)
    host, port = server.servers[0].sockets[0].getsockname()[:2]
    yield f"http://{host}:{port}"
    server.should_exit = True
    thread.join(10)
