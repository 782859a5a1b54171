"""Fills the pipe of its progress and dies."""

import os


def preload() -> None:
    """Nothing to import."""


def needs_processes(task) -> bool:
    return False


def run(task, on_progress) -> None:
    report = on_progress.__self__._fd
    os.set_blocking(report, False)
    try:
        while True:
            os.write(report, b'["load", 1.0, "x"]\n' * 100)
    except BlockingIOError:
        os.kill(os.getpid(), 9)
