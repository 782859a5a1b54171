"""A whole service for tests: `cusp up` in processes of its own, on a free port and a folder of its own."""

import hashlib
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from types import MappingProxyType
from typing import Any

import psutil

from service.client.sync import Client
from service.contract.schemas import Job, Status
from tests.support import settings
from tests.support.settings import FAST
from tests.support.storage import S3, Postgres, free_port

START_TIMEOUT_S = 180.0
QUICK = {"settings": FAST}  # options of a job
LONG = {"settings": settings.LONG}


def wait_until(condition: Callable[[], Any], seconds: float, what: str) -> Any:
    """Poll until `condition` is true, and return what it said."""
    deadline = time.monotonic() + seconds
    while not (found := condition()):
        assert time.monotonic() < deadline, f"waited {seconds} s in vain: {what}"
        time.sleep(0.02)
    return found


def is_alive(process: psutil.Process) -> bool:
    """False when it has ended, waited for or not."""
    try:
        return process.is_running() and bool(process.status() != psutil.STATUS_ZOMBIE)
    except psutil.NoSuchProcess:
        return False


def downloaded(client: Client, job_id: str, folder: Path) -> set[str]:
    """The names of the job's files, each fetched and held against its digest."""
    folder.mkdir(parents=True, exist_ok=True)
    files = client.files(job_id)
    for file in files:
        content = client.download(job_id, file.name, folder / file.name).read_bytes()
        assert hashlib.sha256(content).hexdigest() == file.sha256, (job_id, file)
    return {file.name for file in files}


class RunningService:
    """`cusp up`, started; `log` is what it wrote."""

    def __init__(self, data_dir: Path, **environment: str) -> None:
        self.data_dir = data_dir
        self.log = data_dir.with_suffix(".log")
        self.port = free_port()
        self.client = Client(f"http://127.0.0.1:{self.port}")
        command = [sys.executable, "-m", "service.cli.main", "up", "--port", str(self.port)]
        command += ["--data-dir", data_dir.name]  # relative, as people type it
        with self.log.open("ab") as log:
            environment = {**os.environ, **environment}
            self.parent = psutil.Popen(command, stderr=log, env=environment, cwd=data_dir.parent)
        wait_until(self._is_up, START_TIMEOUT_S, "the service to start")

    def _is_up(self) -> bool:
        assert self.parent.poll() is None, self.log.read_text()
        return self.client.is_ready()

    def part(self, name: str) -> psutil.Process:
        """The process `api` or `worker`."""

        def found() -> psutil.Process | None:
            with suppress(psutil.NoSuchProcess):
                return next((each for each in self.parent.children() if name in each.cmdline()), None)
            return None

        process: psutil.Process = wait_until(found, START_TIMEOUT_S, f"a process {name}")
        return process

    def job_processes(self) -> list[psutil.Process]:
        """The children that compute: the zygote's."""
        with suppress(psutil.NoSuchProcess):
            zygotes = [
                each
                for each in self.part("worker").children()
                if "service.execution.zygote" in each.cmdline()
            ]
            return [child for zygote in zygotes for child in zygote.children()]
        return []

    def running(self, job_id: str) -> psutil.Process:
        """Wait until the job computes; its process."""
        wait_until(lambda: self.client.job(job_id).stage is not None, 60, "the job to compute")
        process: psutil.Process = wait_until(self.job_processes, 5, "its process")[0]
        return process

    def finish(self, job_id: str, seconds: float = 240.0) -> Job:
        """Wait for the end of a job."""
        return self.client.wait(job_id, timeout_s=seconds, interval_s=0.1)

    def successful(self, job_id: str) -> Job:
        """Wait for the end of a job, which must be good."""
        job = self.finish(job_id)
        assert job.status is Status.SUCCESSFUL, (job, self.log.read_text())
        return job

    def stop(self) -> float:
        """SIGTERM; how many seconds the end took."""
        begun = time.monotonic()
        self.parent.terminate()
        with suppress(subprocess.TimeoutExpired):
            self.parent.wait(20)
        took = time.monotonic() - begun
        self.kill_everything()
        return took

    def kill_everything(self) -> None:
        """SIGKILL to every process of the service at once."""
        with suppress(psutil.NoSuchProcess):
            family = [self.parent, *self.parent.children(recursive=True)]
            for process in family:
                with suppress(psutil.NoSuchProcess):
                    process.send_signal(signal.SIGKILL)
            psutil.wait_procs(family, timeout=10)
        self.client.close()


class ScaledService:
    """`cusp api` and some `cusp worker`, each alone, on one PostgreSQL and one S3; `log` is what all of them
    wrote.
    """

    def __init__(
        self,
        folder: Path,
        server: Postgres,
        s3: S3,
        workers: int,
        of_part: Mapping[str, dict[str, str]] = MappingProxyType({}),
        **environment: str,
    ) -> None:
        """of_part : variables of single parts, by name"""
        self._of_part = of_part
        name = f"scaled_{free_port()}"
        self.folder, self.port = folder, free_port()
        self.log = folder / "log"
        self.environment = {
            **os.environ,
            **s3.environment,
            "CUSP_DATABASE_URL": server.create(name),
            "CUSP_BLOB_URL": f"s3://{s3.bucket}/{name}",
            "CUSP_PORT": str(self.port),
            "CUSP_JOBS": "1",
            **environment,
        }
        self.client = Client(f"http://127.0.0.1:{self.port}")
        self.api = self.start("api", "api")
        self.workers = [self.start("worker", f"worker-{number}") for number in range(workers)]
        try:
            wait_until(self.client.is_ready, START_TIMEOUT_S, "the service to start")
        except AssertionError as error:
            self.stop()
            raise AssertionError(self.log.read_text()) from error

    def start(self, part: str, name: str) -> psutil.Popen:
        """A part of this name, in a data folder of its own."""
        with self.log.open("ab") as log:
            return psutil.Popen(
                [sys.executable, "-m", "service.cli.main", part],
                stderr=log,
                env={
                    **self.environment,
                    "CUSP_WORKER_ID": name,
                    "CUSP_DATA_DIR": str(self.folder / name),
                    **self._of_part.get(name, {}),
                },
            )

    def replace(self, worker: psutil.Popen) -> None:
        """Another of that name for one that ended; returns when it takes jobs."""
        number = self.workers.index(worker)
        ready = self.log.read_text().count("worker ready")
        self.workers[number] = self.start("worker", f"worker-{number}")
        wait_until(
            lambda: self.log.read_text().count("worker ready") > ready,
            START_TIMEOUT_S,
            "the new worker to be ready",
        )

    def busy(self) -> psutil.Popen:
        """The worker that computes now."""

        def found() -> psutil.Popen | None:
            for worker in self.workers:
                zygotes = [each for each in worker.children() if "service.execution.zygote" in each.cmdline()]
                if any(zygote.children() for zygote in zygotes):
                    return worker
            return None

        return wait_until(found, 60, "a worker that computes")

    def stop(self) -> None:
        """SIGTERM to all; those that stay are killed."""
        parts = [self.api, *self.workers]
        for part in parts:
            with suppress(psutil.NoSuchProcess):
                part.terminate()
        _, left = psutil.wait_procs(parts, timeout=15)
        for part in left:
            part.kill()
            part.wait()
        self.client.close()
        assert not left, self.log.read_text()
