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

from service.blobs import BlobStore
from service.engine import migrate_queue
from service.keys import Exposed, KeyStore, check_exposure
from service.settings import ServiceSettings
from service.store import migrate, open_database
from service.worker_main import EXIT_BROKEN

STOP_TIMEOUT_S = 8.0
LOOK_INTERVAL_S = 0.1
SHORT_LIFE_S = 10.0  # a process that ends sooner than this did not get anywhere
MAX_SHORT_LIVES = 3
log = structlog.get_logger()


class AlreadyRunning(Exception):
    """Another service works on the data folder."""


@dataclass(slots=True)
class Part:
    """One of the two processes."""

    name: str
    process: "subprocess.Popen[bytes]"
    started_at: float
    short_lives: int = 0


def prepare(settings: ServiceSettings) -> IO[bytes]:
    """Make folders and tables. Keep what it returns: the lock on the folder goes with it.

    Raises
    ------
    AlreadyRunning, Exposed
    """
    settings.make_folders()
    lock = (settings.data_dir / "lock").open("ab")
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        lock.close()
        raise AlreadyRunning(
            f"another cusp works on {settings.data_dir.resolve()}; stop it, or choose another --data-dir"
        ) from error
    BlobStore(settings.blob_dir).clear_incoming()  # uploads that a crash cut off
    for path in settings.tmp_dir.iterdir():
        path.unlink(missing_ok=True)
    migrate(settings.database_path)
    migrate_queue(settings.queue_path)
    engine = open_database(settings.database_path)
    try:
        check_exposure(settings, KeyStore(engine))
    except Exposed:
        lock.close()
        raise
    finally:
        engine.dispose()
    return lock


def run_up(settings: ServiceSettings) -> int:
    """Run until SIGTERM or Ctrl-C, or until a part cannot be kept alive. Returns the exit code."""
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


def _keep_alive(parts: list[Part], start: Callable[[str], "subprocess.Popen[bytes]"], stop: threading.Event) -> int:
    while not stop.wait(LOOK_INTERVAL_S):
        for part in parts:
            code = part.process.poll()
            if code is None:
                continue
            lived_s = time.monotonic() - part.started_at
            part.short_lives = part.short_lives + 1 if lived_s < SHORT_LIFE_S else 0
            # An API that cannot bind its port ends with the same code: uvicorn's for "did not start".
            if code == EXIT_BROKEN or part.short_lives >= MAX_SHORT_LIVES:
                log.error("a part cannot run; see its messages above", part=part.name, exit_code=code)
                return 1
            log.error("a part died and is started again", part=part.name, exit_code=code)
            part.process, part.started_at = start(part.name), time.monotonic()
    return 0


def _start(settings: ServiceSettings, name: str) -> "subprocess.Popen[bytes]":
    # A group of its own: Ctrl-C reaches this parent only, which then stops the parts in order.
    return subprocess.Popen(  # noqa: S603 (our own module)
        [sys.executable, "-m", "service.cli", name, "--parent", str(os.getpid())],
        env={**os.environ, **settings.environment()},
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
