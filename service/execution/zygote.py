"""The process that forks the child of every job: it has imported the libraries and has one thread.

    python -m service.execution.zygote FD TARGET

FD is a socket (SOCK_SEQPACKET) to the worker, which no child has. It receives {"start": key, "folder",
"memory_limit_bytes"} with the write end of a pipe for the child's progress, and {"kill": key}. It sends
{"event": "started" | "refused" | "ended", "key", ...}; what it says of an end is what the kernel said. The
task of the job is in the file task.json of its folder. When the socket closes, because the worker ended,
every child is killed and this process ends.

Nothing here waits for a child or for the worker: one that is stuck would stop all jobs.
"""

import gc
import importlib
import json
import os
import selectors
import signal
import socket
import sys
import time
from collections import deque
from contextlib import suppress
from dataclasses import asdict, dataclass
from types import ModuleType
from typing import Any

from service.execution import forked, process
from service.execution.confinement.confine import Confinement

WATCH_INTERVAL_S = 0.05  # between checks of the children's memory
MESSAGE_BYTES = 64 * 1024
MAX_REAPED = 200  # children in one turn: a job that makes them without an end must not keep the zygote
HEADLESS_S = 1.0  # how long the first thread of a job may have ended before the others; at its end some ms
MAX_PROCESSES = 16  # of one job; a STEP is read in a second process, nothing needs a third
MAX_THREADS = 512  # of one job; libraries start one for each core
ORPHAN_INTERVAL_S = 0.002
ORPHAN_TIMEOUT_S = 2.0  # a killed process ends in milliseconds, unless it waits in the kernel


@dataclass(slots=True)
class Child:
    """A job that runs. Its process group has the number of its pid."""

    key: str
    pid: int
    memory_limit_bytes: int
    headless_since: float | None = None  # monotonic
    ended_by: str | None = None  # "kill", "memory" or "processes", when this process ended it


@dataclass(slots=True)
class End:
    """A child that ended; told to the worker when no process that it left is alive."""

    event: dict[str, Any]
    told_at: float  # the latest, on the monotonic clock


class Zygote:
    """Forks, watches and reaps. Single-threaded, since only then a fork is safe."""

    def __init__(self, control: socket.socket, target: ModuleType, confinement: Confinement) -> None:
        self._control = control
        self._confinement = confinement
        self._target = target
        self._children: dict[int, Child] = {}
        self._ends: list[End] = []
        self._unsent: deque[bytes] = deque()
        self._wake_read, self._wake_write = os.pipe()
        for fd in (self._wake_read, self._wake_write):
            os.set_blocking(fd, False)
        control.setblocking(False)
        signal.signal(signal.SIGCHLD, lambda *_: None)  # only so that it writes to the pipe
        signal.set_wakeup_fd(self._wake_write, warn_on_full_buffer=False)

    def serve(self) -> None:
        """Run until the worker ends."""
        with selectors.DefaultSelector() as selector:
            selector.register(self._control, selectors.EVENT_READ)
            selector.register(self._wake_read, selectors.EVENT_READ)
            while True:
                for key, events in selector.select(self._pause_s()):
                    if key.fileobj is self._wake_read:
                        with suppress(BlockingIOError):
                            os.read(self._wake_read, 4096)
                    elif events & selectors.EVENT_READ and not self._receive():
                        self._kill_all()
                        return
                self._reap()
                self._tell_ends()
                self._watch()
                self._flush()
                waits = selectors.EVENT_READ | (selectors.EVENT_WRITE if self._unsent else 0)
                selector.modify(self._control, waits)

    def _pause_s(self) -> float | None:
        if self._ends:
            return ORPHAN_INTERVAL_S
        return WATCH_INTERVAL_S if self._children else None

    def _receive(self) -> bool:
        try:
            message, fds, _, _ = socket.recv_fds(self._control, MESSAGE_BYTES, 1)
        except BlockingIOError:
            return True
        except ConnectionError:
            return False
        if not message:
            return False
        order = json.loads(message)
        if "start" in order:
            try:
                self._start(order, fds[0])
            finally:
                os.close(fds[0])  # it is the child's alone
        else:
            for child in self._children.values():
                if child.key == order["kill"]:
                    child.ended_by = child.ended_by or "kill"
                    process.kill_group(child.pid)
        return True

    def _start(self, order: dict[str, Any], progress_fd: int) -> None:
        try:
            pid = os.fork()
        except OSError as error:  # the limit of processes or of memory is reached; it may pass
            self._send({"event": "refused", "key": order["start"], "reason": str(error)})
            return
        if pid == 0:
            forked.main(self._target, order, progress_fd, self._confinement, self._inherited_fds())
        self._children[pid] = Child(order["start"], pid, order["memory_limit_bytes"])
        self._send({"event": "started", "key": order["start"], "pid": pid})

    def _inherited_fds(self) -> list[int]:
        """File descriptors that a child must close."""
        return [self._control.fileno(), self._wake_read, self._wake_write]

    def _reap(self) -> None:
        for _ in range(MAX_REAPED):
            try:
                # Kill the group before reaping: until then its number cannot be reused.
                ended_child = os.waitid(os.P_ALL, 0, os.WEXITED | os.WNOHANG | os.WNOWAIT)
            except ChildProcessError:
                return
            if ended_child is None:
                return
            if ended_child.si_pid in self._children:
                process.kill_group(ended_child.si_pid)
            _, status, usage = os.wait4(ended_child.si_pid, 0)
            if child := self._children.pop(ended_child.si_pid, None):
                event = {"event": "ended", "key": child.key, "status": status, "by": child.ended_by}
                event["peak_bytes"] = usage.ru_maxrss * 1024
                self._ends.append(End(event, time.monotonic() + ORPHAN_TIMEOUT_S))

    def _kill_orphans(self) -> bool:
        """Kill processes that jobs left in other groups; True if there were any.

        They are our children now, since we are a subreaper. When one of them ends, we adopt its children too.
        """
        orphans = [pid for pid in process.children_of(os.getpid()) if pid not in self._children]
        for pid in orphans:
            process.kill_process(pid)
        return bool(orphans)

    def _tell_ends(self) -> None:
        if not self._ends:
            return
        is_clear = not self._kill_orphans()
        now = time.monotonic()
        for end in [end for end in self._ends if is_clear or now > end.told_at]:
            self._ends.remove(end)
            self._send(end.event)

    def _watch(self) -> None:
        """End jobs whose processes together exceed a limit, and processes that hide from their job."""
        if self._children:
            self._kill_orphans()
        for child in self._children.values():
            if child.ended_by is None and (limit := self._exceeded(child)) is not None:
                child.ended_by = limit
                process.kill_group(child.pid)

    def _exceeded(self, child: Child) -> str | None:
        own = (child.pid, *process.descendants_of(child.pid, MAX_PROCESSES))
        if len(own) > MAX_PROCESSES or sum(process.threads_of(pid) for pid in own) > MAX_THREADS:
            return "processes"
        if any(process.is_headless(pid) for pid in own):
            now = time.monotonic()
            child.headless_since = child.headless_since or now
            if now - child.headless_since > HEADLESS_S:
                return "processes"
        else:
            child.headless_since = None
        used = sum(process.resident_bytes(pid) for pid in own)
        return "memory" if used > child.memory_limit_bytes else None

    def _send(self, event: dict[str, Any]) -> None:
        self._unsent.append(json.dumps(event).encode())

    def _flush(self) -> None:
        with suppress(BlockingIOError, ConnectionError):  # later; or the worker ended, as a read will tell
            while self._unsent:
                self._control.send(self._unsent[0])
                self._unsent.popleft()

    def _kill_all(self) -> None:
        for child in self._children.values():
            process.kill_group(child.pid)
        self._children.clear()  # they count as orphans now
        deadline = time.monotonic() + ORPHAN_TIMEOUT_S
        while self._kill_orphans() and time.monotonic() < deadline:
            self._reap()
            time.sleep(ORPHAN_INTERVAL_S)


def main(control_fd: int, target_name: str) -> None:
    """Import, report ready, serve."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C reaches the whole terminal; the worker decides
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    process.adopt_orphans()
    control = socket.socket(fileno=control_fd)
    target = importlib.import_module(target_name)
    target.preload()
    confinement = Confinement.prepare()
    gc.collect()
    gc.freeze()  # keep the collector of each child from copying every page
    control.send(json.dumps({"event": "ready", "measures": asdict(confinement.measures)}).encode())
    Zygote(control, target, confinement).serve()


if __name__ == "__main__":
    main(int(sys.argv[1]), sys.argv[2])
