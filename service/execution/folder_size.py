"""How much of the disk a job uses: its folder, and files that it deleted but keeps open."""

import os
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

MAX_ENTRIES = 10_000  # of a folder; a job has some tens
BLOCK_BYTES = 512  # unit of `st_blocks`


def used_bytes(folder: Path, pid: int | None) -> int:
    """Bytes on the disk. More than any limit (2^63) when there are more than MAX_ENTRIES files."""
    total = 0
    for count, status in enumerate(_statuses(folder, pid)):
        if count >= MAX_ENTRIES:
            return 2**63
        total += status.st_blocks * BLOCK_BYTES
    return total


def _statuses(folder: Path, pid: int | None) -> Iterator[os.stat_result]:
    todo = [str(folder)]
    while todo:
        with suppress(OSError), os.scandir(todo.pop()) as entries:
            for entry in entries:
                with suppress(OSError):
                    yield entry.stat(follow_symlinks=False)
                    if entry.is_dir(follow_symlinks=False):
                        todo.append(entry.path)
    if pid is not None:
        with suppress(OSError):
            for fd in os.listdir(f"/proc/{pid}/fd"):  # noqa: PTH208 (names of no path)
                with suppress(OSError):
                    status = os.stat(f"/proc/{pid}/fd/{fd}")  # noqa: PTH116 (a link to no path)
                    if status.st_nlink == 0:
                        yield status
