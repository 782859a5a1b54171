"""Code of an attacker in a job's process: makes attempts, and writes down which of them the kernel let it."""

import ctypes
import errno
import fcntl
import json
import mmap
import os
import resource
import signal
import socket
import sqlite3
import subprocess
import threading
import time
from pathlib import Path

STAY_S = 60.0  # that what it has taken stays taken; the service ends it before
HAPPENED = "happened"
LIBC = ctypes.CDLL(None, use_errno=True)


def preload() -> None:
    """Nothing to import."""


def needs_processes(task) -> bool:
    return bool(task.get("with_processes"))


def checked(result: int) -> None:
    if result < 0:
        raise OSError(ctypes.get_errno(), os.strerror(ctypes.get_errno()))


def prlimit_of(pid: int) -> None:
    resource.prlimit(pid, resource.RLIMIT_CPU, (1, 1))


def open_database(path: str) -> None:
    sqlite3.connect(f"file:{path}?mode=ro", uri=True).execute("SELECT * FROM jobs").fetchall()


def start_threads(count: int) -> None:
    pause = threading.Event()
    for _ in range(count):
        threading.Thread(target=pause.wait, daemon=True).start()


def fork(count: int) -> None:
    for _ in range(count):
        if os.fork() == 0:
            signal.pause()


def write_files() -> None:
    for number in range(1 << 20):
        Path(f"{number}.bin").write_bytes(bytes(1 << 20))


def write_unlinked_files() -> None:
    held = []
    while True:
        held.append(Path("hidden.bin").open("wb"))  # noqa: SIM115 (open to the end)
        held[-1].write(bytes(1 << 22))
        held[-1].flush()
        Path("hidden.bin").unlink()


def make_many_files() -> None:
    for number in range(1 << 30):
        Path(f"{number}").touch()


def own_signals_of_a_pipe(pid: int) -> None:
    """The kernel would send signals to that process in our name."""
    fcntl.fcntl(os.pipe()[0], fcntl.F_SETOWN, pid)


def share_memory() -> None:
    """Of no file, but not private either."""
    held = []
    for _ in range(400):
        held.append(mmap.mmap(-1, 1 << 20))
        held[-1].write(bytes(range(256)) * 4096)
    time.sleep(STAY_S)


def write_mapped_files() -> None:
    """Deleted and closed: only the mapping of one page keeps each."""
    LIBC.mmap.restype = ctypes.c_void_p
    for _ in range(400):
        with Path("hidden.bin").open("w+b") as file:
            file.write(bytes(1 << 20))
            file.flush()
            if LIBC.mmap(None, ctypes.c_size_t(4096), 3, 1, file.fileno(), ctypes.c_long(0)) in (-1, None):
                raise OSError(ctypes.get_errno(), "mmap")
        Path("hidden.bin").unlink()
    time.sleep(STAY_S)


def end_its_first_thread() -> None:
    """The kernel then says nothing of what the others use."""

    def hold() -> None:
        held = [bytes(1 << 20) for _ in range(50)]
        time.sleep(STAY_S)
        held.clear()

    threading.Thread(target=hold).start()
    LIBC.syscall(60 if os.uname().machine == "x86_64" else 93, 0)


def set_mode(path: str) -> None:
    before = os.stat(path).st_mode  # noqa: PTH116
    os.chmod(path, 0)  # noqa: PTH101
    if os.stat(path).st_mode == before:  # noqa: PTH116
        raise PermissionError(errno.EPERM, "nothing was changed")


def leave_the_group() -> None:
    """Of processes, which is killed as a whole."""
    pid = os.fork()
    if pid == 0:
        try:
            os.setsid()
        except OSError:
            os._exit(1)
        os._exit(0)
    if os.waitpid(pid, 0)[1] != 0:
        raise PermissionError(errno.EPERM, "setsid")


def start_threads_elsewhere() -> None:
    threading.stack_size(65536)
    LIBC.mallopt(-8, 1)  # M_ARENA_MAX: or they reach the limit of addresses
    if os.fork() == 0:
        start_threads(900)
        time.sleep(STAY_S)
    time.sleep(STAY_S)


def take_a_name_that_is_no_text() -> None:
    checked(LIBC.prctl(15, b"\xff\xfe\x1cRss", 0, 0, 0))
    time.sleep(0.3)


def write_deep_files() -> None:
    """Below the longest path that the system takes."""
    for _ in range(30):
        os.mkdir("d" * 200)  # noqa: PTH102 (in a folder without a path)
        os.chdir("d" * 200)
    write_files()


def move_a_folder() -> None:
    """Who lists folders that move all the time misses what is in them."""
    os.mkdir("moves")  # noqa: PTH102
    os.rename("moves", "moved")  # noqa: PTH104


def write_into_a_locked_folder() -> None:
    """Files can be made there, but not listed."""
    os.mkdir("locked", 0o300)  # noqa: PTH102 (its mode)
    os.chdir("locked")
    write_files()


def write_sparse_files() -> None:
    """They take no room until they are stored."""
    for number in range(8):
        with Path(f"{number}.bin").open("wb") as file:
            file.truncate(1 << 29)


def nest_folders() -> None:
    for _ in range(5000):
        os.mkdir("d")  # noqa: PTH102 (in a folder without a path)
        os.chdir("d")
    time.sleep(STAY_S)


ATTEMPTS = {
    "read a blob": lambda task: Path(task["blob"]).read_bytes(),
    "list the data folder": lambda task: os.listdir(Path(task["blob"]).parent),  # noqa: PTH208
    "read the folder of another job": lambda task: Path(task["sibling"], "task.json").read_bytes(),
    "write into the folder of another job": lambda task: Path(task["sibling"], "x").write_text("x"),
    "link a blob into the results": lambda task: os.link(task["blob"], "stolen"),
    "write into the program": lambda task: Path(__file__).with_suffix(".new").write_text("x"),
    "read the database": lambda task: open_database(task["database"]),
    "read the passwords of the machine": lambda task: Path("/etc/shadow").read_bytes(),
    "read the environment of the worker": lambda task: Path(f"/proc/{task['worker']}/environ").read_bytes(),
    "read the memory of the zygote": lambda task: os.open(f"/proc/{os.getppid()}/mem", os.O_RDONLY),
    "connect by TCP": lambda task: socket.create_connection(("127.0.0.1", task["port"]), 1),
    "send by UDP": lambda task: socket.socket(socket.AF_INET, socket.SOCK_DGRAM).sendto(
        b"x", ("127.0.0.1", 9)
    ),
    "connect to a local socket": lambda task: socket.socket(socket.AF_UNIX).connect("\0cusp-test"),
    "trace the zygote": lambda task: checked(LIBC.ptrace(16, os.getppid(), None, None)),
    "signal the zygote": lambda task: os.kill(os.getppid(), signal.SIGTERM),
    "signal another job": lambda task: os.kill(task["neighbour"], signal.SIGKILL),
    "signal the thread of another job": lambda task: checked(
        LIBC.syscall(234 if os.uname().machine == "x86_64" else 131, task["neighbour"], task["neighbour"], 9)
    ),
    "signal everybody": lambda task: os.kill(-1, signal.SIGKILL),
    "limit another job": lambda task: prlimit_of(task["neighbour"]),
    "move another job to one processor": lambda task: os.sched_setaffinity(task["neighbour"], {0}),
    "raise its own limits": lambda task: resource.setrlimit(resource.RLIMIT_AS, (1 << 50, 1 << 50)),
    "raise its own priority": lambda task: os.setpriority(os.PRIO_PROCESS, 0, -5),
    "become another user": lambda task: os.setuid(12345),
    "enter a namespace of its own": lambda task: checked(LIBC.unshare(0x10000000)),
    "mount a file system": lambda task: checked(LIBC.mount(b"none", b".", b"tmpfs", 0, None)),
    "move a folder": lambda task: move_a_folder(),
    "change the mode of a blob": lambda task: set_mode(task["blob"]),
    "change the times of a blob": lambda task: os.utime(task["blob"], (0, 0)),
    "have a table of open files for one thread": lambda task: checked(LIBC.syscall(436, 900, 901, 2)),
    "leave the group of the job": lambda task: leave_the_group(),
    "have the kernel signal another job": lambda task: own_signals_of_a_pipe(task["neighbour"]),
    "hide memory in a file": lambda task: os.memfd_create("hidden"),
    "start a program": lambda task: subprocess.run(["/bin/true"], check=True),
    "fork 10,000 times": lambda task: fork(10_000),
    "start 10,000 threads": lambda task: start_threads(10_000),
    "fill the disk": lambda task: write_files(),
    "fill the disk with deleted files": lambda task: write_unlinked_files(),
    "make a million files": lambda task: make_many_files(),
    "end its first thread": lambda task: end_its_first_thread(),
    "take a name that is no text": lambda task: take_a_name_that_is_no_text(),
    "start 900 threads in a second process": lambda task: start_threads_elsewhere(),
    "share memory with itself": lambda task: share_memory(),
    "fill the disk with mapped files": lambda task: write_mapped_files(),
    "fill the disk below any path": lambda task: write_deep_files(),
    "fill the disk in a locked folder": lambda task: write_into_a_locked_folder(),
    "leave sparse files": lambda task: write_sparse_files(),
    "nest 5,000 folders": lambda task: nest_folders(),
}


def run(task, on_progress) -> None:
    happened: dict[str, str] = {}
    path = Path.cwd() / HAPPENED
    for name in task["attempts"]:
        happened[name] = attempt(name, task)
        path.write_text(json.dumps(happened))


def attempt(name: str, task) -> str:
    try:
        ATTEMPTS[name](task)
    except OSError as error:
        return errno.errorcode.get(error.errno, str(error))
    except (sqlite3.OperationalError, RuntimeError, ValueError) as error:
        return str(error)
    return "allowed"
