"""Leaves a chain of daemons behind, each in a session of its own and the parent of the next."""

import json
import os
import time
from contextlib import suppress
from pathlib import Path

DEPTH = 4


def preload() -> None:
    """Nothing to import."""


def needs_processes(task) -> bool:
    return True


def run(task, on_progress) -> None:
    folder = Path(task["folder"])
    if os.fork() == 0:
        chain(folder, DEPTH)
    while not (folder / f"{DEPTH}.pid").exists():  # the last: each waits for the one below
        time.sleep(0.001)
    passing = folder / "pids.part"
    passing.write_text(json.dumps([int(path.read_text()) for path in folder.glob("*.pid")]))
    passing.rename(folder / "pids.json")
    while task.get("stay"):
        time.sleep(0.01)
    os._exit(0)


def chain(folder: Path, depth: int) -> None:
    with suppress(PermissionError):  # where system calls are filtered
        os.setsid()
    if depth > 1 and os.fork() == 0:
        chain(folder, depth - 1)
    passing = folder / f"{depth}.part"
    passing.write_text(str(os.getpid()))
    while depth > 1 and not (folder / f"{depth - 1}.pid").exists():
        time.sleep(0.001)
    passing.rename(folder / f"{depth}.pid")
    time.sleep(600)
    os._exit(0)
