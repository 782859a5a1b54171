"""Reports progress as fast as it can, until its time is over."""

import os


def preload() -> None:
    """Nothing to import."""


def needs_processes(task) -> bool:
    return False


def run(task, on_progress) -> None:
    report = on_progress.__self__._fd
    os.set_blocking(report, True)
    line = 0
    while True:
        line += 1
        os.write(report, b'["load", %d, "line"]\n' % (line % 100))
