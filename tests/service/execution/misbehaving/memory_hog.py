"""Takes memory page by page, and touches it."""

import time


def preload() -> None:
    """Nothing to import."""


def needs_processes(task) -> bool:
    return False


def run(task, on_progress) -> None:
    held = []
    while True:
        held.append(b"x" * (8 * 1024 * 1024))
        time.sleep(0.001)
