"""`cusp up`: the API and a worker under one parent, on one data folder."""

import fcntl
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import IO

import structlog

from service.auth.keys import KeyStore, check_exposure
from service.execution.process import keep_secrets
from service.execution.worker_process import EXIT_BROKEN
from service.jobs.models import now_ms
from service.jobs.queue import migrate_queue
from service.settings import ServiceSettings
from service.storage.blobs import BlobStore
from service.storage.database import check_sqlite, migrate, migrating, open_database

STOP_TIMEOUT_S = 8.0
POLL_INTERVAL_S = 0.1
SHORT_LIFE_S = 10.0  # a process that ends sooner failed to start
MAX_SHORT_LIVES = 3
#: For the API: by default glibc gives each thread a heap and keeps freed memory. Not for the worker: its jobs
#: compute.
SMALL_HEAP = {"MALLOC_ARENA_MAX": "2", "MALLOC_TRIM_THRESHOLD_": "131072"}
log = structlog.get_logger()


class AlreadyRunning(Exception):
    """Another service uses the data folder."""


class NotApart(Exception):
    """A part was started alone without a shared database."""


@dataclass(slots=True)
class Part:
    """One of the two processes."""

    name: str
    process: "subprocess.Popen[bytes]"
    started_at: float
    short_lives: int = 0


def prepare(settings: ServiceSettings, part: str = "up") -> IO[bytes]:
    """Create folders and tables. Keep the returned file open: it holds the lock on the folder.

    part : `up` for all; `api` or `worker` for one of many on a common database

    Raises
    ------
    AlreadyRunning, Exposed, NotApart, NoDatabase
    """
    if part != "up" and settings.is_embedded:
        raise NotApart(
            f"`cusp {part}` needs CUSP_DATABASE_URL (PostgreSQL), shared by all parts; or use `cusp up`"
        )
    check_sqlite(settings.queue)
    settings.make_folders()
    lock = _locked(settings, part)
    try:
        if part != "worker":
            _clear_uploads(settings)
        with migrating(settings.database):
            migrate(settings.database)
            migrate_queue(settings.queue)
        if part != "worker":
            engine = open_database(settings.database)
            try:
                check_exposure(settings, KeyStore(engine))
            finally:
                engine.dispose()
    except BaseException:
        lock.close()
        raise
    return lock


def _locked(settings: ServiceSettings, part: str) -> IO[bytes]:
    names = {"up": "lock", "api": "lock.api", "worker": f"lock.worker.{settings.worker_id}"}
    lock = (settings.data_dir / names[part]).open("ab")
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        lock.close()
        remedy = "another CUSP_WORKER_ID" if part == "worker" else "another --data-dir"
        raise AlreadyRunning(
            f"another cusp uses {settings.data_dir.resolve()}; stop it, or choose {remedy}"
        ) from error
    return lock


def _clear_uploads(settings: ServiceSettings) -> None:
    """Delete uploads interrupted by a crash. In a bucket other uploads may be active: see `Retention`."""
    if not settings.blob_url:
        BlobStore(settings.blobs).clear_incoming(older_than_ms=now_ms())
    for path in settings.tmp_dir.iterdir():
        path.unlink(missing_ok=True)


def run_up(settings: ServiceSettings) -> int:
    """Run until SIGTERM or Ctrl-C, or until a part cannot run. Returns the exit code."""
    keep_secrets()
    stop = threading.Event()
    for kind in (signal.SIGTERM, signal.SIGINT):
        signal.signal(kind, lambda *_: stop.set())
    with prepare(settings):
        parts = [Part(name, _start(settings, name), time.monotonic()) for name in ("api", "worker")]
        address = f"http://{settings.host}:{settings.port}"
        log.info("service starts", address=address, data_dir=str(settings.data_dir), jobs=settings.jobs)
        try:
            return _keep_alive(parts, lambda name: _start(settings, name), stop)
        finally:
            _stop_all(parts)
            log.info("service stopped")


def _keep_alive(
    parts: list[Part], start: Callable[[str], "subprocess.Popen[bytes]"], stop: threading.Event
) -> int:
    while not stop.wait(POLL_INTERVAL_S):
        for part in parts:
            code = part.process.poll()
            if code is None:
                continue
            lived_s = time.monotonic() - part.started_at
            # A part that was killed (code < 0) can run: it is restarted without a limit.
            part.short_lives = part.short_lives + (code > 0) if lived_s < SHORT_LIFE_S else 0
            # An API that cannot bind its port ends with the same code: uvicorn's for "did not start".
            if code == EXIT_BROKEN or part.short_lives >= MAX_SHORT_LIVES:
                log.error("a part cannot run; see its messages above", part=part.name, exit_code=code)
                return 1
            log.error("a part died and is restarted", part=part.name, exit_code=code)
            part.process, part.started_at = start(part.name), time.monotonic()
    return 0


def _start(settings: ServiceSettings, name: str) -> "subprocess.Popen[bytes]":
    # A group of its own: Ctrl-C reaches this parent only, which then stops the parts in order.
    return subprocess.Popen(  # noqa: S603 (our own module)
        [sys.executable, "-m", "service.cli.part", name, "--parent", str(os.getpid())],
        env={**(SMALL_HEAP if name == "api" else {}), **os.environ, **settings.environment()},
        process_group=0,
    )


def _stop_all(parts: list[Part]) -> None:
    for part in parts:
        part.process.terminate()
    deadline = time.monotonic() + STOP_TIMEOUT_S
    for part in parts:
        try:
            part.process.wait(max(0.1, deadline - time.monotonic()))
        except subprocess.TimeoutExpired:
            log.error("a part does not stop and is killed", part=part.name)
            part.process.kill()
            part.process.wait()
