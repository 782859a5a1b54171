"""One service in this process: real tables and blobs in a temporary folder, a queue that only takes notes, and a
worker that runs a job when the test says so."""

import shutil
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import httpx
import pytest
import structlog
import uvicorn
from fastapi import FastAPI

from service.app import create_app
from service.blobs import BlobStore
from service.design_cache import DesignCache
from service.job_store import JobStore
from service.metrics import Metrics
from service.sandbox import Outcome
from service.settings import ServiceSettings
from service.store import migrate, open_database
from service.worker import Worker

TRIANGLE_OBJ = b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"
RESULTS = b'{"schema_version": "1", "verdict": {"status": "ok"}}'


@dataclass
class NotingQueue:
    """Stands in for DBOS."""

    waiting: list[str] = field(default_factory=list)
    broken: bool = False

    def enqueue(self, job_id: str) -> None:
        if self.broken:
            raise ConnectionError("the queue is away")
        if job_id not in self.waiting:
            self.waiting.append(job_id)

    requeue = enqueue

    def drop(self, job_id: str) -> None:
        if job_id in self.waiting:
            self.waiting.remove(job_id)

    def tickets(self) -> set[str]:
        return set(self.waiting)


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
    migrate(path)
    return path


@pytest.fixture
def settings(tmp_path: Path, migrated: Path) -> ServiceSettings:
    made = ServiceSettings(data_dir=tmp_path / "data", max_upload_mib=1, queue_limit=5)
    made.make_folders()
    shutil.copy(migrated, made.database_path)
    return made


@pytest.fixture
def service(settings: ServiceSettings) -> Iterator[Service]:
    engine = open_database(settings.database_path)
    jobs, blobs, queue, sandbox = (
        JobStore(engine),
        BlobStore(settings.blob_dir),
        NotingQueue(),
        ScriptedSandbox(),
    )
    designs, metrics = DesignCache(blobs.store, settings.design_cache_mib), Metrics(engine, settings.data_dir)
    worker = Worker("worker-1", jobs, blobs, designs, sandbox, settings.scratch_dir, metrics)  # type: ignore[arg-type]
    with serving(create_app(settings, queue)) as address, httpx.Client(base_url=address, timeout=30) as http:
        yield Service(http, jobs, blobs, queue, sandbox, worker, settings)
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
