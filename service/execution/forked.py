"""The child process of a job after the fork: it limits itself, computes, and writes its answer."""

import faulthandler
import json
import os
import signal
import traceback
from contextlib import suppress
from pathlib import Path
from types import ModuleType
from typing import Any, NoReturn

from pipeline import PipelineError
from service.contract.errors import JobCrashed, JobOutOfMemory, ServiceError, problem_of
from service.execution import process
from service.execution.confinement.confine import Confinement
from service.execution.confinement.limits import limit_resources
from service.execution.job_answer import write_answer
from service.execution.progress_pipe import ProgressWriter

NICE = 10  # the API has priority
TASK_FILE = "task.json"  # in the job's folder: a message on the zygote's socket must fit into one packet
MIB = 1024 * 1024


def main(
    target: ModuleType,
    order: dict[str, Any],
    progress_fd: int,
    confinement: Confinement,
    close: list[int],
) -> NoReturn:
    """Never returns: no exception may unwind into the loop of the zygote."""
    code = 1
    try:
        folder = Path(order["folder"])
        _prepare_process(folder, close)
        limit_resources(order["memory_limit_bytes"])
        task = json.loads(Path(TASK_FILE).read_bytes())  # the job's folder is the working directory
        confinement.apply(folder, with_processes=target.needs_processes(task))
        code = _work(target, task, order["memory_limit_bytes"], ProgressWriter(progress_fd))
    finally:
        os._exit(code)


def _prepare_process(folder: Path, close: list[int]) -> None:
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
    os.chdir(folder)
    log = os.open("child.log", os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o600)
    os.dup2(log, 1)
    os.dup2(log, 2)
    faulthandler.enable(2)  # writes a traceback to child.log


def _work(target: ModuleType, task: dict[str, Any], memory_limit_bytes: int, progress: ProgressWriter) -> int:
    try:
        target.run(task, progress.send)
    except MemoryError:
        return _answer(JobOutOfMemory(out_of_memory_detail(memory_limit_bytes // MIB)))
    except PipelineError as error:
        return _answer(error)
    except Exception as error:
        traceback.print_exc()
        detail = f"an unexpected {type(error).__name__} in the computation; report it with the id of the job"
        return _answer(JobCrashed(detail))
    return _answer(None)


def _answer(error: PipelineError | ServiceError | None) -> int:
    write_answer(None if error is None else problem_of(error))
    return 0


def out_of_memory_detail(limit_mib: int) -> str:
    """The `detail` of JobOutOfMemory."""
    return (
        f"the job exceeded its memory limit of {limit_mib} MiB; decimate the meshes, lower "
        "resample.target_vertices, or raise CUSP_JOB_MEMORY_LIMIT_MIB"
    )
