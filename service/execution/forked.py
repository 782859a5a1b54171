"""The first steps of a job's child process after the fork: fences first, then the work, then the report."""

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

NICE = 10  # the API answers first
TASK_FILE = "task.json"  # in the job's folder: an order on the zygote's socket has to fit into one packet
MIN_PROGRESS_INTERVAL_S = 0.05
MIB = 1024 * 1024
MIN_FILE_LIMIT_BYTES = 1024 * MIB  # a file of results may be larger than a small limit of memory


def main(target: ModuleType, order: dict[str, Any], report_fd: int, close: list[int]) -> NoReturn:
    """Never returns: whatever happens here must not unwind into the zygote's loop."""
    code = 1
    try:
        _fence(Path(order["folder"]), order["memory_limit_bytes"], close)
        code = _work(target, order, Report(report_fd))
    finally:
        os._exit(code)


class Report:
    """JSON lines to the worker."""

    def __init__(self, fd: int) -> None:
        self._fd = fd
        self._stage = ""
        self._told_at = 0.0

    def progress(self, stage: str, percent: float, message: str) -> None:
        """Every new stage, and of the steps within one at most one every MIN_PROGRESS_INTERVAL_S."""
        now = time.monotonic()
        if stage == self._stage and now - self._told_at < MIN_PROGRESS_INTERVAL_S:
            return
        self._stage, self._told_at = stage, now
        self.tell({"event": "progress", "stage": stage, "progress": percent, "message": message})

    def tell(self, event: dict[str, Any]) -> None:
        """One line. A pipe takes up to 4096 bytes in one piece; longer ones are this process's alone as well."""
        left = json.dumps(event).encode() + b"\n"
        while left:
            left = left[os.write(self._fd, left) :]


def _fence(folder: Path, memory_limit_bytes: int, close: list[int]) -> None:
    zygote_pid = os.getppid()
    os.setsid()
    process.die_with_parent(zygote_pid)
    signal.set_wakeup_fd(-1)
    for kind in (signal.SIGCHLD, signal.SIGTERM, signal.SIGINT):
        signal.signal(kind, signal.SIG_DFL)
    for fd in close:
        os.close(fd)
    os.nice(NICE)
    # Linux may share the processor out among sessions first, and this one is a session of its own.
    with suppress(OSError):
        Path("/proc/self/autogroup").write_text(str(NICE))
    process.offer_to_oom_killer()
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    largest_file = max(memory_limit_bytes, MIN_FILE_LIMIT_BYTES)
    resource.setrlimit(resource.RLIMIT_FSIZE, (largest_file, largest_file))  # the disk is everybody's
    # The limit that counts is resident memory, watched by the zygote: thread stacks, allocator arenas and mapped
    # libraries reserve gigabytes of addresses they never touch. This one stops what grows faster than the watch.
    process.limit_address_space(2 * memory_limit_bytes)
    os.chdir(folder)
    log = os.open("child.log", os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o600)
    os.dup2(log, 1)
    os.dup2(log, 2)
    faulthandler.enable(2)  # a segfault says where in child.log


def _work(target: ModuleType, order: dict[str, Any], report: Report) -> int:
    try:
        task = json.loads(Path(TASK_FILE).read_bytes())  # of the job's folder, where we are
        target.run(task, report.progress)
    except MemoryError:
        limit_mib = order["memory_limit_bytes"] // MIB
        return _give_up(report, JobOutOfMemory(out_of_memory_detail(limit_mib)))
    except PipelineError as error:
        return _give_up(report, error)
    except Exception as error:
        traceback.print_exc()
        detail = f"an unforeseen {type(error).__name__} while the meshes were worked on; report it with the job's id"
        return _give_up(report, JobCrashed(detail))
    report.tell({"event": "done"})
    return 0


def _give_up(report: Report, error: PipelineError | ServiceError) -> int:
    report.tell({"event": "problem", "problem": problem_of(error).model_dump(exclude_none=True)})
    return 0


def out_of_memory_detail(limit_mib: int) -> str:
    """What a client reads."""
    return (
        f"the job needed more than the {limit_mib} MiB of memory it may take; decimate the meshes, lower "
        "resample.target_vertices, or raise CUSP_JOB_MEMORY_LIMIT_MIB"
    )
