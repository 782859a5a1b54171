"""Runs each job in a child process of its own and reports how that process ended.

A zygote (`zygote.py`) forks the children. This is the worker's side; it is safe to use from many threads.
The time limit and the question whether a job is still wanted have their own clock here: neither waits for
what the child or the zygote says.
"""

import json
import os
import select
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import structlog

from service.contract.schemas import Problem
from service.execution import process
from service.execution.confinement.measures import Measures
from service.execution.exit_reasons import explain_exit, no_process
from service.execution.folder_watch import FolderWatch
from service.execution.forked import TASK_FILE
from service.execution.job_answer import JobAnswer, read_answer, read_regular_file
from service.execution.job_limits import Limits
from service.execution.progress_pipe import ProgressReader
from service.execution.zygote_link import Run, SandboxError, ZygoteLink

POLL_INTERVAL_S = 0.2  # between checks of the time limit and of `is_wanted`
READ_INTERVAL_S = 0.05  # between reads of the progress of one job, however much it writes
START_RETRY_S = 30.0  # how long a process is asked for that the system refuses
START_PAUSE_S = 0.5
KILL_GRACE_S = 5.0  # a killed child ends in milliseconds; after this the zygote counts as dead
MIB = 1024 * 1024
LOG_TAIL_BYTES = 4000
log = structlog.get_logger()

__all__ = ["Limits", "Outcome", "Sandbox", "SandboxError", "log_tail"]


@dataclass(frozen=True, slots=True)
class Outcome:
    """How a job's process ended. `unwanted`: killed because `is_wanted` said so."""

    kind: Literal["done", "failed", "unwanted"]
    problem: Problem | None
    seconds: float
    peak_mib: float | None


KilledFor = Literal["time", "disk", "unwanted"]
OnProgress = Callable[[str, float, str], None]  # stage, percent, message


class Sandbox:
    """`target` names the module whose `preload()`, `needs_processes(task)` and `run(task, on_progress)` the
    processes call.
    """

    def __init__(self, limits: Limits, *, target: str = "service.execution.child") -> None:
        self._limits = limits
        self._target = target
        self._lock = threading.Lock()
        self._link: ZygoteLink | None = None

    def start(self) -> None:
        """Start the zygote unless it runs, and wait until it can fork.

        Raises
        ------
        SandboxError
            With the standard error of the zygote: usually a missing system library.
        """
        self._started()

    def _started(self) -> ZygoteLink:
        with self._lock:
            if self._link is not None and not self._link.is_alive:
                log.warning("zygote died", exit_code=self._link.process.returncode, said=self._link.tail())
                self._link.close()
                self._link = None
            if self._link is None:
                self._link = ZygoteLink(self._target)
            return self._link

    @property
    def measures(self) -> Measures:
        """How the processes are confined; starts the zygote if there is none."""
        return self._started().measures

    def stop(self) -> None:
        """Kill every job and the zygote."""
        with self._lock:
            if self._link is not None:
                self._link.close()
                self._link = None

    def run(
        self, key: str, task: dict[str, Any], on_progress: OnProgress, is_wanted: Callable[[], bool]
    ) -> Outcome:
        """Run one job to its end. `task["folder"]` must exist; the task and `child.log` are written there.

        When the system has no room for a process, the start is tried again for START_RETRY_S.
        `is_wanted` is called every POLL_INTERVAL_S; if it returns False, the process group is killed. Neither
        it nor `on_progress` may wait: the time limit is checked between the calls.
        """
        folder = Path(task["folder"])
        (folder / TASK_FILE).write_text(json.dumps(task))
        first_at = time.monotonic()
        while True:
            tried = self._try(key, folder, on_progress, is_wanted)
            if isinstance(tried, Outcome):
                return tried
            seconds = time.monotonic() - first_at
            log.warning("no process for the job", job=key, reason=tried, seconds=round(seconds, 1))
            if not is_wanted():
                return Outcome("unwanted", None, seconds, None)
            if seconds > START_RETRY_S:
                return Outcome("failed", no_process(tried), seconds, None)
            time.sleep(START_PAUSE_S)

    def _try(
        self,
        key: str,
        folder: Path,
        on_progress: OnProgress,
        is_wanted: Callable[[], bool],
    ) -> Outcome | str:
        """The outcome, or the reason why the system refused a process."""
        link = self._started()
        read_fd, write_fd = os.pipe()
        try:
            try:
                order = {
                    "folder": str(folder),
                    "memory_limit_bytes": self._limits.memory_mib * MIB,
                }
                run = link.start(key, order, write_fd)
            finally:
                os.close(write_fd)
            watch = FolderWatch(folder, self._limits.disk_mib * MIB)
            try:
                progress = ProgressReader(read_fd)
                return self._follow(link, run, folder, progress, watch, on_progress, is_wanted)
            except BaseException:
                link.kill(key)  # a listener failed: nobody would stop the child
                raise
            finally:
                watch.close()
                link.forget(run)
        finally:
            os.close(read_fd)

    def _follow(
        self,
        link: ZygoteLink,
        run: Run,
        folder: Path,
        progress: ProgressReader,
        watch: FolderWatch,
        on_progress: OnProgress,
        is_wanted: Callable[[], bool],
    ) -> Outcome | str:
        started_at = looked_at = time.monotonic()
        killed_for: KilledFor | None = None
        killed_at = read_at = 0.0
        while not run.is_over:
            now = time.monotonic()
            may_read = not progress.is_closed and now - read_at >= READ_INTERVAL_S
            pause_s = POLL_INTERVAL_S if may_read or progress.is_closed else READ_INTERVAL_S
            fds = [run.wake_fd, *([progress.fd] if may_read else [])]
            readable, _, _ = select.select(fds, [], [], pause_s)
            if run.wake_fd in readable:
                run.clear_wake()
            if progress.fd in readable:
                read_at = time.monotonic()
                self._report(progress, on_progress, is_killed=killed_for is not None)
            now = time.monotonic()
            if killed_for is not None:
                if now - killed_at > KILL_GRACE_S:
                    link.process.kill()
                    break
            elif now - started_at > self._limits.time_s:
                killed_for = "time"
            elif now - looked_at > POLL_INTERVAL_S:
                looked_at = now
                if not is_wanted():
                    killed_for = "unwanted"
                elif watch.is_over(run.pid):
                    killed_for = "disk"
            if killed_for is not None and not killed_at:
                killed_at = now
                link.kill(run.key)
        seconds = time.monotonic() - started_at
        if run.refused is not None:
            return run.refused
        if run.ended is None:
            if run.pid is not None:
                process.kill_group(run.pid)
        else:
            self._report(progress, on_progress, is_killed=killed_for is not None)
            if killed_for is None and run.ended.get("by") is None and watch.is_over_at_the_end():
                killed_for = "disk"  # written since the last look: nothing of it may be stored
        return self._outcome(run, read_answer(folder), killed_for, seconds)

    @staticmethod
    def _report(progress: ProgressReader, on_progress: OnProgress, *, is_killed: bool) -> None:
        for message in progress.read():
            if not is_killed:
                on_progress(*message)

    def _outcome(
        self,
        run: Run,
        answer: JobAnswer | None,
        killed_for: KilledFor | None,
        seconds: float,
    ) -> Outcome:
        ended = run.ended or {}
        peak_mib = _peak(run)
        if killed_for == "unwanted":
            return Outcome("unwanted", None, seconds, peak_mib)
        # A limit that was noticed counts, although the process may have ended before it was killed.
        by = killed_for or ended.get("by")
        if answer is not None and ended and by is None:
            if answer.problem is not None:
                return Outcome("failed", answer.problem, seconds, peak_mib)
            if ended["status"] == 0:
                return Outcome("done", None, seconds, peak_mib)
        problem = explain_exit(
            ended.get("status"),
            by,
            peak_mib,
            self._limits,
        )
        return Outcome("failed", problem, seconds, peak_mib)


def _peak(run: Run) -> float | None:
    """MiB that the process of an ended run took at most."""
    return None if run.ended is None else float(run.ended["peak_bytes"]) / MIB


def log_tail(folder: Path) -> str:
    """The end of the output of a job's process: for the log, not for clients."""
    said = read_regular_file(folder / "child.log", LOG_TAIL_BYTES, end=True)
    return "" if said is None else said.decode(errors="replace")
