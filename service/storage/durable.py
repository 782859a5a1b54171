"""fsync: file systems delay writes, but stored files must be on disk before the database refers to them."""

import os
from collections.abc import Iterable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

PARALLEL = 8  # the journal of the file system commits simultaneous calls together


def settle(paths: Iterable[Path]) -> None:
    """Return when files, or the entries of folders, would survive a loss of power."""
    with ThreadPoolExecutor(PARALLEL) as pool:
        for _ in pool.map(_settle, paths):
            pass


def _settle(path: Path) -> None:
    file = os.open(path, os.O_RDONLY)
    try:
        os.fsync(file)
    finally:
        os.close(file)
