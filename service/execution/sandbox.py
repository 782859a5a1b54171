"""Runs each job in a child process of its own and reports how that process ended.

A zygote (`zygote.py`) forks the children. This is the worker's side; it is safe to use from many threads.
"""

import json
import os
import re
import select
import socket
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any, Literal

import structlog

from service.contract.schemas import Problem
from service.execution import process
from service.execution.exit_reasons import explain_exit
from service.execution.forked import TASK_FILE

READY_TIMEOUT_S = 120.0  # imports take two seconds, longer from a cold disk
POLL_INTERVAL_S = 0.2  # between checks of the time limit, of `is_wanted` and of the zygote
STOP_GRACE_S = 2.0
KILL_GRACE_S = 5.0  # a killed child ends in milliseconds; after this the zygote counts as dead
log = structlog.get_logger()

MAX_LINE_BYTES = 1024 * 1024  # of a message of a child; a longer line is not one

ONE_THREAD = {
    "OPENBLAS_NUM_THREADS": "1",
    "OMP_NUM_THREADS": "1",
}  # before the imports: a fork needs one thread
#: Environment variables passed to the processes that read untrusted meshes. Passwords and keys may have any
#: name, so
#: only variables that are needed are passed.
KEPT = {"PATH", "HOME", "LANG", "LANGUAGE", "TZ", "TMPDIR", "LD_LIBRARY_PATH", "VIRTUAL_ENV", "MPLCONFIGDIR"}
KEPT_FAMILIES = re.compile(r"(LC|PYTHON|XDG|FONTCONFIG|OPENBLAS|OMP|MALLOC|LIBGL|MESA)\w*|\w+_NUM_THREADS")


class SandboxError(Exception):
    """No job can run: the zygote does not start."""


@dataclass(frozen=True, slots=True)
class Limits:
    """Time and memory limit of one job."""

    time_s: float
    memory_mib: int


@dataclass(frozen=True, slots=True)
class Outcome:
    """How a job's process ended. `unwanted`: killed because `is_wanted` said so."""

    kind: Literal["done", "failed", "unwanted"]
    problem: Problem | None
    seconds: float
    peak_mib: float | None


OnProgress = Callable[[str, float, str], None]  # stage, percent, message


class Sandbox:
    """`target` names the module whose `preload()` and `run(task, on_progress)` the processes call."""

    def __init__(self, limits: Limits, *, target: str = "service.execution.child") -> None:
        self._limits = limits
        self._target = target
        self._lock = threading.Lock()
        self._zygote: subprocess.Popen[bytes] | None = None
        self._control: socket.socket | None = None
        self._output: IO[bytes] | None = None  # standard output and error of the zygote

    def start(self) -> None:
        """Start the zygote unless it runs, and wait until it can fork.

        Raises
        ------
        SandboxError
            With the standard error of the zygote: usually a missing system library.
        """
        with self._lock:
            if self._zygote is not None and self._zygote.poll() is None:
                return
            self._spawn()

    def stop(self) -> None:
        """Kill every job and the zygote."""
        with self._lock:
            self._close()  # the zygote kills its children and ends
            if self._zygote is not None:
                with suppress(subprocess.TimeoutExpired):
                    self._zygote.wait(STOP_GRACE_S)
                self._zygote.kill()
                self._zygote.wait()
                self._zygote = None

    def run(
        self, key: str, task: dict[str, Any], on_progress: OnProgress, is_wanted: Callable[[], bool]
    ) -> Outcome:
        """Run one job to its end. `task["folder"]` must exist; the task and `child.log` are written there.

        `is_wanted` is called every POLL_INTERVAL_S; if it returns False, the process group is killed.
        """
        self.start()
        zygote = self._zygote
        read_fd, write_fd = os.pipe()
        order = {
            "start": key,
            "folder": task["folder"],
            "memory_limit_bytes": self._limits.memory_mib * 1024 * 1024,
        }
        try:
            try:
                Path(task["folder"], TASK_FILE).write_text(json.dumps(task))
                self._send(order, [write_fd])
            finally:
                os.close(write_fd)
            return self._follow(key, zygote, _Lines(read_fd), on_progress, is_wanted)
        except BaseException:
            self._send({"kill": key}, [])  # a listener failed: nobody would stop the child
            raise
        finally:
            os.close(read_fd)

    def _follow(
        self,
        key: str,
        zygote: "subprocess.Popen[bytes] | None",
        lines: "_Lines",
        on_progress: OnProgress,
        is_wanted: Callable[[], bool],
    ) -> Outcome:
        started_at = time.monotonic()
        killed_for: Literal["time", "unwanted"] | None = None
        killed_at = 0.0
        looked_at = started_at
        pid: int | None = None
        told: dict[str, Any] = {}
        while True:
            for event in lines.read(POLL_INTERVAL_S):
                match event["event"]:
                    case "started":
                        pid = event["pid"]
                    case "progress" if killed_for is None:
                        on_progress(event["stage"], event["progress"], event["message"])
                    case "done" | "problem":
                        told = event
                    case "ended":
                        return self._outcome(told, event, killed_for, time.monotonic() - started_at)
            now = time.monotonic()
            hangs = killed_for is not None and now - killed_at > KILL_GRACE_S
            if hangs or lines.closed or zygote is None or zygote.poll() is not None:
                if pid is not None:
                    process.kill_group(pid)
                if hangs and zygote is not None:
                    zygote.kill()
                return self._outcome(told, {}, killed_for, now - started_at)
            if killed_for is None:
                if now - started_at > self._limits.time_s:
                    killed_for = "time"
                elif now - looked_at > POLL_INTERVAL_S:
                    looked_at = now
                    killed_for = None if is_wanted() else "unwanted"
                if killed_for is not None:
                    killed_at = now
                    self._send({"kill": key}, [])

    def _outcome(
        self,
        told: dict[str, Any],
        ended: dict[str, Any],
        killed_for: Literal["time", "unwanted"] | None,
        seconds: float,
    ) -> Outcome:
        peak_mib = ended["peak_bytes"] / 2**20 if ended else None
        if killed_for == "unwanted":
            return Outcome("unwanted", None, seconds, peak_mib)
        if told.get("event") == "done" and ended.get("status") == 0:
            return Outcome("done", None, seconds, peak_mib)
        if told.get("event") == "problem":
            return Outcome("failed", Problem.model_validate(told["problem"]), seconds, peak_mib)
        by = "time" if killed_for == "time" else ended.get("by")
        problem = explain_exit(
            ended.get("status"), by, peak_mib, self._limits.memory_mib, self._limits.time_s
        )
        return Outcome("failed", problem, seconds, peak_mib)

    def _send(self, order: dict[str, Any], fds: list[int]) -> None:
        with self._lock, suppress(OSError):  # a dead zygote is noticed by whoever waits for its answer
            if self._control is not None:
                socket.send_fds(self._control, [json.dumps(order).encode()], fds)

    def _spawn(self) -> None:
        if self._zygote is not None:
            log.warning("zygote died", exit_code=self._zygote.returncode, said=self._tail())
        self._close()
        self._output = tempfile.TemporaryFile()  # noqa: SIM115 (open as long as the zygote)
        ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        with theirs:
            self._zygote = subprocess.Popen(  # noqa: S603 (our own module)
                [sys.executable, "-m", "service.execution.zygote", str(theirs.fileno()), self._target],
                pass_fds=[theirs.fileno()],
                env={**kept_environment(), **ONE_THREAD},
                stdin=subprocess.DEVNULL,
                stdout=self._output,
                stderr=self._output,
            )
        self._control = ours
        ours.settimeout(READY_TIMEOUT_S)
        try:
            is_ready = bool(ours.recv(4096))
        except (TimeoutError, ConnectionError):
            is_ready = False
        if not is_ready:
            self._zygote.kill()
            self._zygote.wait()
            self._zygote, said = None, self._tail()
            self._close()
            raise SandboxError(f"the process that jobs are forked from does not start:\n{said}")
        ours.settimeout(None)

    def _close(self) -> None:
        for kept in (self._control, self._output):
            if kept is not None:
                kept.close()
        self._control = self._output = None

    def _tail(self) -> str:
        if self._output is None:
            return ""
        self._output.seek(0)
        return self._output.read().decode(errors="replace").strip()[-4000:]


class _Lines:
    """JSON lines from a pipe, with a time-out."""

    def __init__(self, fd: int) -> None:
        self._fd = fd
        self._partial = b""
        self.closed = False

    def read(self, timeout_s: float) -> Iterator[dict[str, Any]]:
        """The lines that are there, or come within `timeout_s`."""
        readable, _, _ = select.select([self._fd], [], [], timeout_s)
        if not readable:
            return
        chunk = os.read(self._fd, 65536)
        self.closed = not chunk
        *lines, self._partial = (self._partial + chunk).split(b"\n")
        self._partial = self._partial[-MAX_LINE_BYTES:]
        for line in lines:
            with suppress(ValueError):  # an incomplete line of a process that died
                event = json.loads(line)
                if isinstance(event, dict) and "event" in event:
                    yield event


def kept_environment() -> dict[str, str]:
    """The environment variables that a zygote gets."""
    return {
        name: value for name, value in os.environ.items() if name in KEPT or KEPT_FAMILIES.fullmatch(name)
    }


def log_tail(folder: Path, length: int = 4000) -> str:
    """The end of the output of a job's process: for the log, not for clients."""
    try:
        return (folder / "child.log").read_text(errors="replace")[-length:]
    except OSError:
        return ""
