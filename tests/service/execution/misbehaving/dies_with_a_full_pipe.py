"""Has its worker read once, fills the pipe of its progress and dies."""

import array
import fcntl
import mmap
import os
import termios
from pathlib import Path


def preload() -> None:
    """Nothing to import."""


def needs_processes(task) -> bool:
    return False


def run(task, on_progress) -> None:
    Path(task["folder"], "pid").write_text(str(os.getpid()))
    report = on_progress.__self__._fd
    line = b'["load", 1.0, "x"]'
    os.write(report, line + b"\n")
    while unread_bytes(report):
        os.sched_yield()
    os.set_blocking(report, False)
    try:
        while True:
            os.write(report, line.ljust(mmap.PAGESIZE - 1) + b"\n")  # whole pages: no byte is left
    except BlockingIOError:
        os.set_blocking(report, True)  # whoever else writes to this pipe has to wait
        os.kill(os.getpid(), 9)


def unread_bytes(fd: int) -> int:
    count = array.array("i", [0])
    fcntl.ioctl(fd, termios.FIONREAD, count)
    return count[0]
