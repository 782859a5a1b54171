"""The child process of a job after the fork: it limits itself, computes, and reports."""

import faulthandler
import json
import os
import resource
import signal
import time
import traceback
from contextlib import suppress
from pathlib import Path
from types import ModuleType
from typing import Any, NoReturn

from pipeline import PipelineError
from service.contract.errors import JobCrashed, JobOutOfMemory, ServiceError, problem_of
from service.execution import process

NICE = 10  # the API has priority
TASK_FILE = "task.json"  # in the job's folder: a message on the zygote's socket must fit into one packet
MIN_PROGRESS_INTERVAL_S = 0.05
MIB = 1024 * 1024
MIN_FILE_LIMIT_BYTES = 1024 * MIB  # a file of results may be larger than a small limit of memory


def main(target: ModuleType, order: dict[str, Any], report_fd: int, close: list[int]) -> NoReturn:
    """Never returns: no exception may unwind into the loop of the zygote."""
    code = 1
    try:
        _limit_process(Path(order["folder"]), order["memory_limit_bytes"], close)
        code = _work(target, order, Report(report_fd))
    finally:
        os._exit(code)


class Report:
    """JSON lines to the worker."""

    def __init__(self, fd: int) -> None:
        self._fd = fd
        self._stage = ""
        self._sent_at = 0.0

    def progress(self, stage: str, percent: float, message: str) -> None:
        """Send each new stage; within a stage at most one message every MIN_PROGRESS_INTERVAL_S."""
        now = time.monotonic()
        if stage == self._stage and now - self._sent_at < MIN_PROGRESS_INTERVAL_S:
            return
        self._stage, self._sent_at = stage, now
        self.send({"event": "progress", "stage": stage, "progress": percent, "message": message})

    def send(self, event: dict[str, Any]) -> None:
        """Write one line. Writes of up to 4096 bytes are atomic; no other process writes longer ones."""
        left = json.dumps(event).encode() + b"\n"
        while left:
            left = left[os.write(self._fd, left) :]


def _limit_process(folder: Path, memory_limit_bytes: int, close: list[int]) -> None:
    zygote_pid = os.getppid()
    os.setsid()
    process.die_with_parent(zygote_pid)
    signal.set_wakeup_fd(-1)
    for kind in (signal.SIGCHLD, signal.SIGTERM, signal.SIGINT):
        signal.signal(kind, signal.SIG_DFL)
    for fd in close:
        os.close(fd)
    os.nice(NICE)
    # Linux may schedule by session first, and this process has a session of its own.
    with suppress(OSError):
        Path("/proc/self/autogroup").write_text(str(NICE))
    process.offer_to_oom_killer()
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    largest_file = max(memory_limit_bytes, MIN_FILE_LIMIT_BYTES)
    resource.setrlimit(resource.RLIMIT_FSIZE, (largest_file, largest_file))  # the disk is shared
    # The zygote enforces the limit of resident memory: thread stacks, allocator arenas and libraries reserve
    # gigabytes of addresses that they never touch. This limit stops what grows faster than the zygote polls.
    process.limit_address_space(2 * memory_limit_bytes)
    os.chdir(folder)
    log = os.open("child.log", os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o600)
    os.dup2(log, 1)
    os.dup2(log, 2)
    faulthandler.enable(2)  # writes a traceback to child.log


def _work(target: ModuleType, order: dict[str, Any], report: Report) -> int:
    try:
        task = json.loads(Path(TASK_FILE).read_bytes())  # the job's folder is the working directory
        target.run(task, report.progress)
    except MemoryError:
        limit_mib = order["memory_limit_bytes"] // MIB
        return _report_problem(report, JobOutOfMemory(out_of_memory_detail(limit_mib)))
    except PipelineError as error:
        return _report_problem(report, error)
    except Exception as error:
        traceback.print_exc()
        detail = f"an unexpected {type(error).__name__} in the computation; report it with the id of the job"
        return _report_problem(report, JobCrashed(detail))
    report.send({"event": "done"})
    return 0


def _report_problem(report: Report, error: PipelineError | ServiceError) -> int:
    report.send({"event": "problem", "problem": problem_of(error).model_dump(exclude_none=True)})
    return 0


def out_of_memory_detail(limit_mib: int) -> str:
    """The `detail` of JobOutOfMemory."""
    return (
        f"the job exceeded its memory limit of {limit_mib} MiB; decimate the meshes, lower "
        "resample.target_vertices, or raise CUSP_JOB_MEMORY_LIMIT_MIB"
    )
