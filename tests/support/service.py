"""One service in this process: real tables and blobs in a temporary folder, a queue that only takes notes,
and a worker that runs a job when the test says so.
"""

import asyncio
import socket
import ssl
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import httpx
import uvicorn
from fastapi import FastAPI
from sqlalchemy import text

from service.execution.sandbox import Outcome
from service.execution.worker import Worker
from service.jobs.dispatcher import Dispatcher
from service.jobs.store import JobStore
from service.settings import ServiceSettings
from service.storage.blobs import BlobStore
from service.storage.database import open_database

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
        """Jobs with a queue entry, once the dispatcher has run."""
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


def spoil(service: Service, job_id: str, **values: str) -> None:
    """Damage a row by hand, as a later version or a broken disk might."""
    engine = open_database(service.settings.database)
    with engine.begin() as connection:
        for column, value in values.items():
            statement = f"UPDATE jobs SET {column} = :value WHERE id = :id"  # noqa: S608 (our own words)
            connection.execute(text(statement), {"value": value, "id": job_id})
    engine.dispose()


class _Server(uvicorn.Server):
    """A server that starts and stops at once; uvicorn's own looks only every 0.1 s whether it should stop."""

    def __init__(self, app: FastAPI) -> None:
        super().__init__(uvicorn.Config(app, port=0, log_config=None))
        self.running = threading.Event()

    def stop(self) -> None:
        """To be called from another thread."""
        self._loop.call_soon_threadsafe(self._stopped.set)

    async def main_loop(self) -> None:
        self._loop, self._stopped = asyncio.get_running_loop(), asyncio.Event()
        await self.on_tick(0)  # sets the headers that every answer has
        self.running.set()
        await self._stopped.wait()

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        for server in self.servers:
            server.close()
        for connection in list(self.server_state.connections):
            connection.shutdown()
        deadline = time.monotonic() + 1.0
        while (self.server_state.connections or self.server_state.tasks) and time.monotonic() < deadline:
            await asyncio.sleep(0.002)
        for task in self.server_state.tasks:
            task.cancel()
        await self.lifespan.shutdown()


@contextmanager
def serving(app: FastAPI) -> Iterator[str]:
    """A real server in a thread of this process, on a port that the system chose."""
    server = _Server(app)
    thread = threading.Thread(target=server.run)
    thread.start()
    while not server.running.wait(0.2):
        assert thread.is_alive(), "the server did not start"
    host, port = server.servers[0].sockets[0].getsockname()[:2]
    try:
        yield f"http://{host}:{port}"
    finally:
        server.stop()
        thread.join(60)
        assert not thread.is_alive(), "the server did not stop"


#: For clients that speak plain HTTP: by default httpx reads all certificates of the machine, 40 ms a client.
NO_TLS = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)


def http_client(address: str, **given: Any) -> httpx.Client:
    """A client of a service in this process."""
    return httpx.Client(base_url=address, verify=NO_TLS, timeout=30, **given)


def assert_problem(answer: Any, status: int, code: str, *words: str) -> None:
    assert answer.status_code == status, answer.text
    assert answer.headers["content-type"] == "application/problem+json"
    problem = answer.json()
    assert (problem["status"], problem["code"]) == (status, code)
    for word in words:
        assert word in problem["detail"]
