"""Writes without an end, and half of a line, what is no progress to where its progress goes."""

import os


def preload() -> None:
    """Nothing to import."""


def needs_processes(task) -> bool:
    return False


def run(task, on_progress) -> None:
    report = on_progress.__self__._fd
    os.set_blocking(report, True)
    for _ in range(8):
        os.write(report, b"\xff" * 65536)
    os.write(report, b'\n[1]\n{"no": "event"}\n"words"\n["load", "x", 1]\n["secret", 1, ""]\n["load", 1')
    os._exit(0)
