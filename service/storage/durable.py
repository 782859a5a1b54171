"""A file system keeps what was written to itself for a while. What the database says is there has to be on the disk before it."""

import os
from collections.abc import Iterable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

PARALLEL = 8  # a journal takes what comes at the same time in one go


def settle(paths: Iterable[Path]) -> None:
    """Return when files, or the names in folders, would be there after a loss of power."""
    with ThreadPoolExecutor(PARALLEL) as pool:
        for _ in pool.map(_settle, paths):
            pass


def _settle(path: Path) -> None:
    file = os.open(path, os.O_RDONLY)
    try:
        os.fsync(file)
    finally:
        os.close(file)
