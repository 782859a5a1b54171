"""The worker's side of a zygote: the process, the socket to it, and a thread that hears what it says.

The thread does nothing but note events, so the zygote never waits for a worker that is busy with a slow
database.
"""

import json
import os
import socket
import struct
import subprocess
import sys
import tempfile
import threading
from contextlib import suppress
from dataclasses import dataclass, field
from typing import IO, Any

import structlog

from service.execution.confinement.measures import Measures
from service.execution.environment import kept_environment

READY_TIMEOUT_S = 120.0  # imports take two seconds, longer from a cold disk
SEND_TIMEOUT_S = 5.0  # the zygote reads within milliseconds; after this it counts as dead
STOP_GRACE_S = 2.0
EVENT_BYTES = 64 * 1024
BEFORE_IMPORTS = {
    "OPENBLAS_NUM_THREADS": "1",  # a fork needs one thread
    "OMP_NUM_THREADS": "1",
}
log = structlog.get_logger()


class SandboxError(Exception):
    """No job can run: the zygote does not start."""


@dataclass(slots=True)
class Run:
    """What the zygote said of one job. `wake_fd` (an eventfd) is readable when there is news."""

    key: str
    wake_fd: int
    pid: int | None = None
    refused: str | None = None  # why no process could be made
    ended: dict[str, Any] | None = None
    is_lost: bool = False  # the zygote died

    def clear_wake(self) -> None:
        """Note that the news was seen, before looking at it."""
        with suppress(BlockingIOError):
            os.eventfd_read(self.wake_fd)

    @property
    def is_over(self) -> bool:
        """True when nothing more will be said."""
        return self.is_lost or self.refused is not None or self.ended is not None


@dataclass
class ZygoteLink:
    """One zygote, from its start to its end.

    Raises
    ------
    SandboxError
        With the standard error of the zygote: usually a missing system library.
    """

    target: str
    _runs: dict[str, Run] = field(default_factory=dict)
    _lock: threading.Lock = field(default_factory=threading.Lock)
    _sending: threading.Lock = field(default_factory=threading.Lock)
    _is_deaf: bool = False  # the listener ended: nothing more will be heard

    def __post_init__(self) -> None:
        self._output: IO[bytes] = tempfile.TemporaryFile()  # noqa: SIM115 (open as long as the zygote)
        self._control, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        with theirs:
            self.process = subprocess.Popen(  # noqa: S603 (our own module)
                [sys.executable, "-P", "-m", "service.execution.zygote", str(theirs.fileno()), self.target],
                pass_fds=[theirs.fileno()],
                env={**kept_environment(), **BEFORE_IMPORTS},
                stdin=subprocess.DEVNULL,
                stdout=self._output,
                stderr=self._output,
            )
        self._await_ready()
        self._listener = threading.Thread(target=self._listen, name="zygote events", daemon=True)
        self._listener.start()

    def _await_ready(self) -> None:
        self._control.settimeout(READY_TIMEOUT_S)
        try:
            ready = self._control.recv(EVENT_BYTES)
        except (TimeoutError, ConnectionError):
            ready = b""
        if not ready:
            self.process.kill()
            self.process.wait()
            said = self.tail()
            self._control.close()
            self._output.close()
            raise SandboxError(f"the process that jobs are forked from does not start:\n{said}")
        self.measures = Measures(**json.loads(ready)["measures"])
        self._control.settimeout(None)
        # A send that waits holds the lock that every job needs; a receive may wait as long as it likes.
        limit = struct.pack("@ll", int(SEND_TIMEOUT_S), 0)
        self._control.setsockopt(socket.SOL_SOCKET, socket.SO_SNDTIMEO, limit)

    @property
    def is_alive(self) -> bool:
        """False once its process ended, or its end of the socket: the socket tells some moments earlier."""
        return not self._is_deaf and self.process.poll() is None

    def start(self, key: str, order: dict[str, Any], progress_fd: int) -> Run:
        """Order a child. The run may be refused or lost later; `forget` it in the end.

        order : `folder` and `memory_limit_bytes`, for `forked.main`
        """
        run = Run(key, os.eventfd(0, os.EFD_NONBLOCK | os.EFD_CLOEXEC))
        with self._lock:
            self._runs[key] = run
            run.is_lost = self._is_deaf
        self._send({"start": key, **order}, [progress_fd])
        return run

    def kill(self, key: str) -> None:
        """Order the end of a child."""
        self._send({"kill": key}, [])

    def forget(self, run: Run) -> None:
        """Release what the run holds."""
        with self._lock:
            self._runs.pop(run.key, None)
            os.close(run.wake_fd)

    def close(self) -> None:
        """Kill every job and the zygote."""
        with suppress(OSError):
            self._control.shutdown(socket.SHUT_RDWR)  # the zygote kills its children and ends
        with suppress(subprocess.TimeoutExpired):
            self.process.wait(STOP_GRACE_S)
        self.process.kill()
        self.process.wait()
        self._listener.join()
        self._control.close()
        self._output.close()

    def tail(self) -> str:
        """The end of what the zygote printed."""
        self._output.seek(0)
        return self._output.read().decode(errors="replace").strip()[-4000:]

    def _send(self, order: dict[str, Any], fds: list[int]) -> None:
        try:
            with self._sending:
                socket.send_fds(self._control, [json.dumps(order).encode()], fds)
        except BlockingIOError:
            log.error("the zygote does not read its orders and is killed")
            self.process.kill()
        except OSError:
            pass  # it died, which the listener tells

    def _listen(self) -> None:
        while True:
            try:
                message = self._control.recv(EVENT_BYTES)
            except OSError:
                message = b""
            if not message:
                break
            event = json.loads(message)
            with self._lock:
                if (run := self._runs.get(event["key"])) is not None:
                    match event["event"]:
                        case "started":
                            run.pid = event["pid"]
                        case "refused":
                            run.refused = event["reason"]
                        case "ended":
                            run.ended = event
                    os.eventfd_write(run.wake_fd, 1)
        with self._lock:
            self._is_deaf = True
            for run in self._runs.values():
                run.is_lost = run.ended is None
                os.eventfd_write(run.wake_fd, 1)
