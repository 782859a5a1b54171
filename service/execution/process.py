"""Linux calls that control a tree of processes."""

import ctypes
import os
import re
import resource
import signal
from contextlib import suppress
from pathlib import Path

PR_SET_PDEATHSIG = 1
PR_SET_DUMPABLE = 4
PR_SET_CHILD_SUBREAPER = 36
_RESIDENT = re.compile(rb"^Rss(?:Anon|Shmem):\s+(\d+) kB$", re.MULTILINE)
_ZOMBIE = re.compile(rb"^State:\s+Z", re.MULTILINE)
_THREADS = re.compile(rb"^Threads:\s+(\d+)$", re.MULTILINE)
OOM_SCORE_OF_JOBS = 900  # out of memory, the kernel kills a job before the service


def die_with_parent(parent_pid: int) -> None:
    """Have the kernel kill this process when its parent ends, however that ends.

    The signal comes when the *thread* that forked this process ends, so call it only in children of a main
    thread.
    """
    _prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
    if os.getppid() != parent_pid:  # it ended before the call
        os._exit(1)


def keep_secrets() -> None:
    """Hide the environment and memory of this process from other processes of the same user.

    The process of a job runs as that user and reads untrusted meshes, and our environment holds passwords.
    Forked processes inherit this; executed ones do not.
    """
    _prctl(PR_SET_DUMPABLE, 0)


def adopt_orphans() -> None:
    """Become the parent of every descendant whose own parent ends, so that none escapes."""
    _prctl(PR_SET_CHILD_SUBREAPER, 1)


def kill_group(group: int) -> None:
    """SIGKILL to a process group; nothing when it is gone."""
    with suppress(ProcessLookupError, PermissionError):
        os.killpg(group, signal.SIGKILL)


def kill_process(pid: int) -> None:
    """SIGKILL to a process; nothing when it is gone."""
    with suppress(ProcessLookupError, PermissionError):
        os.kill(pid, signal.SIGKILL)


def children_of(parent_pid: int) -> list[int]:
    """Pids of the direct children of a process, zombies included; none when it is gone."""
    threads = Path(f"/proc/{parent_pid}/task")
    try:
        lists = [(thread / "children").read_text() for thread in threads.iterdir()]
    except OSError:  # it is gone, or one of its threads, or the kernel has no such file
        return _children_by_search(parent_pid)
    return [int(pid) for pids in lists for pid in pids.split()]


def _children_by_search(parent_pid: int) -> list[int]:
    pids = []
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            with suppress(OSError, ValueError):
                # pid (name) state ppid ...; the name may hold spaces, brackets, and bytes that are no text
                if int((entry / "stat").read_bytes().rpartition(b")")[2].split()[1]) == parent_pid:
                    pids.append(int(entry.name))
    return pids


def descendants_of(pid: int, at_most: int) -> list[int]:
    """Pids of the children of a process and of theirs; no more are looked for once `at_most` are found."""
    found: list[int] = []
    todo = [pid]
    while todo and len(found) < at_most:
        children = children_of(todo.pop())
        found += children
        todo += children
    return found


def threads_of(pid: int) -> int:
    """Number of threads of a process; 0 when it is gone."""
    try:
        return Path(f"/proc/{pid}/task").stat().st_nlink - 2
    except OSError:
        return 0


def resident_bytes(pid: int) -> int:
    """Memory of a process that is its own, copied since the fork, or shared with no file; 0 when it is gone.

    File-backed pages (shared libraries) are not counted, so the same job counts the same in any process.
    """
    return 1024 * sum(int(kib) for kib in _RESIDENT.findall(_status(pid)))


def is_headless(pid: int) -> bool:
    """True if the first thread of a process has ended and others go on: the kernel hides what those use."""
    status = _status(pid)
    threads = _THREADS.search(status)
    return _ZOMBIE.search(status) is not None and threads is not None and int(threads[1]) > 1


def _status(pid: int) -> bytes:
    """Lines of facts; empty when it is gone. A process chooses its name: any bytes, but no end of a line."""
    try:
        return Path(f"/proc/{pid}/status").read_bytes()
    except OSError:
        return b""


def limit_address_space(extra_bytes: int) -> None:
    """Let this process map at most `extra_bytes` more than it has now; beyond, allocations fail."""
    mapped = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (mapped + extra_bytes, mapped + extra_bytes))


def offer_to_oom_killer() -> None:
    """Make this process the first choice of the OOM killer, where the system has that file."""
    with suppress(OSError):
        Path("/proc/self/oom_score_adj").write_text(str(OOM_SCORE_OF_JOBS))


def _prctl(option: int, value: int) -> None:
    libc = ctypes.CDLL(None, use_errno=True)
    if libc.prctl(option, int(value), 0, 0, 0) != 0:
        raise OSError(ctypes.get_errno(), "prctl failed")
