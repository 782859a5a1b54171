"""Why the process of a job ended without a result, in words for the client."""

import os
import signal

from service.contract.errors import (
    JobCrashed,
    JobOutOfDisk,
    JobOutOfMemory,
    JobTimedOut,
    ServiceError,
    problem_of,
)
from service.contract.schemas import Problem
from service.execution.forked import out_of_memory_detail
from service.execution.job_limits import Limits

NEAR_LIMIT = 0.8  # share of the memory limit above which an abort counts as a failed allocation

SIGNAL_HINTS = {
    signal.SIGSEGV: "a fault in native code, usually caused by a damaged mesh: repair it and send it again",
    signal.SIGBUS: "a fault in native code, or a full disk",
    signal.SIGABRT: "native code aborted, usually because of a damaged mesh: repair it and send it again",
    signal.SIGKILL: "not by this service: the machine ran out of memory, or an operator did it; send again",
}


def explain_exit(
    status: int | None,
    by: str | None,
    peak_mib: float | None,
    limits: Limits,
) -> Problem:
    """The problem of a process that ended with wait status `status` (None: unknown).

    `by` is the limit for which this service killed it, if any.
    """
    return problem_of(_error(status, by, peak_mib, limits))


def out_of_disk_detail(limit_mib: int) -> str:
    """The `detail` of JobOutOfDisk."""
    return (
        f"the job exceeded its disk limit of {limit_mib} MiB; decimate the meshes, set report.content to "
        "light, or raise CUSP_JOB_DISK_LIMIT_MIB"
    )


def no_process(reason: str) -> Problem:
    """The problem of a job for which the system gave no process."""
    detail = (
        f"the system has no room for the process of the job ({reason}); send it again, or ask the operator"
    )
    return problem_of(JobCrashed(f"{detail} for a higher limit of processes or memory"))


def _error(status: int | None, by: str | None, peak_mib: float | None, limits: Limits) -> ServiceError:
    if by == "time":
        return JobTimedOut(
            f"the job exceeded its time limit of {limits.time_s:g} s and was stopped; decimate the meshes, "
            "lower resample.target_vertices or the trials of a study, or raise CUSP_JOB_TIME_LIMIT_S"
        )
    if by == "memory":
        return JobOutOfMemory(out_of_memory_detail(limits.memory_mib))
    if by == "disk":
        return JobOutOfDisk(out_of_disk_detail(limits.disk_mib))
    if by == "processes":
        return JobCrashed("the job started more processes than a job needs, and was stopped; report it")
    if status is None:
        return JobCrashed("the parent process of the job died, and the job with it; send it again")
    if not os.WIFSIGNALED(status):
        code = os.waitstatus_to_exitcode(status)
        return JobCrashed(f"the job's process exited with code {code} and without an answer; report it")
    number = os.WTERMSIG(status)
    if number == signal.SIGABRT and peak_mib is not None and peak_mib > NEAR_LIMIT * limits.memory_mib:
        return JobOutOfMemory(out_of_memory_detail(limits.memory_mib))
    name = signal.Signals(number).name if number in set(signal.Signals) else f"signal {number}"
    hint = (
        SIGNAL_HINTS.get(signal.Signals(number), "report it")
        if number in set(signal.Signals)
        else "report it"
    )
    return JobCrashed(f"the job's process was killed by {name}: {hint}")
