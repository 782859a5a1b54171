"""The process that forks the child of every job: it has imported the libraries and has one thread.

    python -m service.execution.zygote FD TARGET

FD is a socket (SOCK_SEQPACKET) to the worker. It receives {"start": key, "folder", "memory_limit_bytes"} with
the write end of a pipe, and {"kill": key}. The task of the job is in the file task.json of its folder. The
worker reads JSON lines from the pipe: "started" from here, "progress", "problem" or "done" from the child, at
last "ended" from here. When the socket closes, because the worker ended, every child is killed and this
process ends.
"""

import gc
import importlib
import json
import os
import selectors
import signal
import socket
import sys
import threading
import time
from contextlib import suppress
from dataclasses import dataclass
from types import ModuleType
from typing import Any

from service.execution import forked, process

WATCH_INTERVAL_S = 0.05  # between checks of the children's memory
MESSAGE_BYTES = 64 * 1024
ORPHAN_TIMEOUT_S = 2.0  # a killed process ends in milliseconds, unless it waits in the kernel


@dataclass(slots=True)
class Child:
    """A job that runs. Its process group has the number of its pid."""

    key: str
    pid: int
    report_fd: int
    memory_limit_bytes: int
    ended_by: str | None = None  # "kill" or "memory", when this process ended it


class Zygote:
    """Forks, watches and reaps. Single-threaded, since only then a fork is safe."""

    def __init__(self, control: socket.socket, target: ModuleType) -> None:
        self._control = control
        self._target = target
        self._children: dict[int, Child] = {}
        self._wake_read, self._wake_write = os.pipe()
        for fd in (self._wake_read, self._wake_write):
            os.set_blocking(fd, False)
        signal.signal(signal.SIGCHLD, lambda *_: None)  # only so that it writes to the pipe
        signal.set_wakeup_fd(self._wake_write, warn_on_full_buffer=False)

    def serve(self) -> None:
        """Run until the worker ends."""
        with selectors.DefaultSelector() as selector:
            selector.register(self._control, selectors.EVENT_READ)
            selector.register(self._wake_read, selectors.EVENT_READ)
            while True:
                for key, _ in selector.select(WATCH_INTERVAL_S if self._children else None):
                    if key.fileobj is self._control:
                        if not self._receive():
                            self._kill_all()
                            return
                    else:
                        with suppress(BlockingIOError):
                            os.read(self._wake_read, 4096)
                self._reap()
                self._watch_memory()

    def _receive(self) -> bool:
        try:
            message, fds, _, _ = socket.recv_fds(self._control, MESSAGE_BYTES, 1)
        except ConnectionError:
            return False
        if not message:
            return False
        order = json.loads(message)
        if "start" in order:
            self._start(order, fds[0])
        else:
            for child in self._children.values():
                if child.key == order["kill"]:
                    child.ended_by = child.ended_by or "kill"
                    process.kill_group(child.pid)
        return True

    def _start(self, order: dict[str, Any], report_fd: int) -> None:
        pid = os.fork()
        if pid == 0:
            forked.main(self._target, order, report_fd, close=self._inherited_fds())
        child = Child(order["start"], pid, report_fd, order["memory_limit_bytes"])
        self._children[pid] = child
        _send_event(child, {"event": "started", "pid": pid})

    def _inherited_fds(self) -> list[int]:
        """File descriptors that a child must close: the control socket and the reports of other jobs."""
        reports = [child.report_fd for child in self._children.values()]
        return [self._control.fileno(), self._wake_read, self._wake_write, *reports]

    def _reap(self) -> None:
        while True:
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
                self._kill_orphans()
                ended = {"event": "ended", "status": status, "by": child.ended_by}
                _send_event(child, {**ended, "peak_bytes": usage.ru_maxrss * 1024})
                os.close(child.report_fd)

    def _kill_orphans(self) -> None:
        """Kill processes that a job left in other groups. They are our children now, since we are a
        subreaper.

        When one of them ends, we adopt its children too: repeat until none is left.
        """
        deadline = time.monotonic() + ORPHAN_TIMEOUT_S
        while time.monotonic() < deadline:
            left = [pid for pid in process.children_of(os.getpid()) if pid not in self._children]
            if not left:
                return
            for pid in left:
                process.kill_process(pid)
            for pid in left:
                with suppress(ChildProcessError):
                    os.waitpid(pid, os.WNOHANG)
            time.sleep(0.001)

    def _watch_memory(self) -> None:
        for child in self._children.values():
            if child.ended_by is None and process.resident_bytes(child.pid) > child.memory_limit_bytes:
                child.ended_by = "memory"
                process.kill_group(child.pid)

    def _kill_all(self) -> None:
        for child in self._children.values():
            process.kill_group(child.pid)
        self._children.clear()  # they count as orphans now
        self._kill_orphans()


def _send_event(child: Child, event: dict[str, Any]) -> None:
    """Write to the report of the job. A line break first: the child may have died within a line."""
    with suppress(BrokenPipeError):
        os.write(child.report_fd, b"\n" + json.dumps(event).encode() + b"\n")


def main(control_fd: int, target_name: str) -> None:
    """Import, report ready, serve."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C reaches the whole terminal; the worker decides
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    process.adopt_orphans()
    control = socket.socket(fileno=control_fd)
    target = importlib.import_module(target_name)
    target.preload()
    gc.collect()
    gc.freeze()  # keep the collector of each child from copying every page
    control.send(json.dumps({"event": "ready", "threads": threading.active_count()}).encode())
    Zygote(control, target).serve()


if __name__ == "__main__":
    main(int(sys.argv[1]), sys.argv[2])
