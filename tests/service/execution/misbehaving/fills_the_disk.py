"""Writes a file that is larger than any result."""

import os
from pathlib import Path


def preload() -> None:
    """Nothing to import."""


def needs_processes(task) -> bool:
    return False


def run(task, on_progress) -> None:
    with Path(task["folder"], "large").open("wb") as file:
        os.truncate(file.fileno(), 1 << 29)
        file.seek(1 << 40)
        file.write(b"x")
        file.flush()
