"""How much of the disk a job uses: its folder, and files that it deleted but keeps open or mapped.

The job may be in the hands of an attacker. A file counts as the larger of its length and its blocks, since a
sparse file takes its full length when it is stored. A folder that cannot be looked into counts as too much.
"""

import errno
import os
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

from service.execution import process

MAX_ENTRIES = 10_000  # of a folder; a job has some tens
MAX_LOOKS = 5  # at a folder in which other folders vanish meanwhile; a job of ours hardly ever removes one
MAX_PROCESSES = 64  # of a job that are looked at; the zygote ends one that has more than 16
TOO_MUCH = 2**63  # bytes; more than any limit
BLOCK_BYTES = 512  # unit of `st_blocks`
#: A folder without permission to read it, or one that lies deeper than the longest path of the system.
HIDDEN = (errno.EACCES, errno.EPERM, errno.ENAMETOOLONG)


def used_bytes(folder: Path, pid: int | None) -> int:
    """Bytes on the disk. TOO_MUCH when there are more than MAX_ENTRIES files, or hidden ones.

    pid : of the job's process, if it lives
    """
    for _ in range(MAX_LOOKS):
        try:
            total = _visible_bytes(folder)
        except Vanished:
            continue
        return total if pid is None else total + _deleted_bytes(folder, pid)
    return TOO_MUCH


class Vanished(Exception):
    """A folder was moved or removed while it was looked at; what it holds may have been missed."""


def _visible_bytes(folder: Path) -> int:
    total = 0
    try:
        for count, status in enumerate(_entries(folder)):
            if count >= MAX_ENTRIES:
                return TOO_MUCH
            total += max(status.st_size, status.st_blocks * BLOCK_BYTES)
    except OSError as error:
        if error.errno in HIDDEN:
            return TOO_MUCH  # other errors are the disk's, not the job's
    return total


def _entries(folder: Path) -> Iterator[os.stat_result]:
    todo = [str(folder)]
    while todo:
        place = todo.pop()
        try:
            with os.scandir(place) as entries:
                for entry in entries:
                    with suppress(FileNotFoundError):
                        yield entry.stat(follow_symlinks=False)
                        if entry.is_dir(follow_symlinks=False):
                            todo.append(entry.path)
        except (FileNotFoundError, NotADirectoryError) as error:
            if place == str(folder):
                return
            raise Vanished from error


def _deleted_bytes(folder: Path, pid: int) -> int:
    """Of files that have no name any more, but live on in a process. TOO_MUCH if one is mapped: no job of
    ours needs that, and the size of what is mapped does not tell that of the file.
    """
    sizes: dict[int, int] = {}  # by inode: the folder is on one file system
    for each in (pid, *process.descendants_of(pid, MAX_PROCESSES)):
        if _maps_deleted_file(each, folder):
            return TOO_MUCH
        sizes.update(_opened(each))
    return sum(sizes.values())


def _opened(pid: int) -> Iterator[tuple[int, int]]:
    """Inode and size of each open file without a name."""
    with suppress(OSError):
        for fd in os.listdir(f"/proc/{pid}/fd"):  # noqa: PTH208 (names of no path)
            with suppress(OSError):
                status = os.stat(f"/proc/{pid}/fd/{fd}")  # noqa: PTH116 (a link to no path)
                if status.st_nlink == 0:
                    yield status.st_ino, max(status.st_size, status.st_blocks * BLOCK_BYTES)


def _maps_deleted_file(pid: int, folder: Path) -> bool:
    with suppress(OSError):
        own = os.fsencode(folder.resolve()) + b"/"
        maps = Path(f"/proc/{pid}/maps").read_bytes()
        return any(own in line for line in maps.split(b"\n") if line.endswith(b" (deleted)"))
    return False
