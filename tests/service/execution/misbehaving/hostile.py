"""Code of an attacker in a job's process: makes attempts, and writes down which of them the kernel let it."""

import ctypes
import errno
import json
import os
import resource
import signal
import socket
import sqlite3
import subprocess
import threading
from pathlib import Path

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
    "hide memory in a file": lambda task: os.memfd_create("hidden"),
    "start a program": lambda task: subprocess.run(["/bin/true"], check=True),
    "fork 10,000 times": lambda task: fork(10_000),
    "start 10,000 threads": lambda task: start_threads(10_000),
    "fill the disk": lambda task: write_files(),
    "fill the disk with deleted files": lambda task: write_unlinked_files(),
    "make a million files": lambda task: make_many_files(),
}


def run(task, on_progress) -> None:
    for name in task["attempts"]:
        Path("happened").write_text(json.dumps({**happened(), name: attempt(name, task)}))


def happened() -> dict[str, str]:
    return json.loads(Path("happened").read_text()) if Path("happened").exists() else {}


def attempt(name: str, task) -> str:
    try:
        ATTEMPTS[name](task)
    except OSError as error:
        return errno.errorcode.get(error.errno, str(error))
    except (sqlite3.OperationalError, RuntimeError, ValueError) as error:
        return str(error)
    return "allowed"
