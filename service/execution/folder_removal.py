"""Removes the folder of a job, whatever code of an attacker made of it."""

import os
import secrets
from contextlib import suppress
from pathlib import Path

OPEN_FOLDER = os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW | os.O_CLOEXEC
OWNER_ALL = 0o700


def remove_folder(folder: Path) -> None:
    """Remove a folder and all in it; nothing if there is none. No process may write there any more.

    A folder without rights is given them. Folders are moved up, one level at a time, so that none is nested
    too deep for a path, for recursion or for the limit of open files.

    Raises OSError if the file system refuses.
    """
    try:
        top = _opened(str(folder), None)
    except (FileNotFoundError, NotADirectoryError):
        return
    try:
        number, prefix = 0, secrets.token_hex(16)  # a name that the job cannot have taken
        while inner := _without_files(top):
            for name in inner:
                below = _opened(name, top)
                try:
                    for deeper in _without_files(below):
                        number += 1
                        _give_rights(deeper, below)
                        os.rename(deeper, f"{prefix}-{number}", src_dir_fd=below, dst_dir_fd=top)
                finally:
                    os.close(below)
                os.rmdir(name, dir_fd=top)
    finally:
        os.close(top)
    folder.rmdir()


def _without_files(folder_fd: int) -> list[str]:
    """Delete what is no folder; the names of the folders."""
    with os.scandir(folder_fd) as entries:
        found = [(entry.name, entry.is_dir(follow_symlinks=False)) for entry in entries]
    for name, is_folder in found:
        if not is_folder:
            with suppress(FileNotFoundError):
                os.unlink(name, dir_fd=folder_fd)
    return [name for name, is_folder in found if is_folder]


def _opened(name: str, parent_fd: int | None) -> int:
    _give_rights(name, parent_fd)
    return os.open(name, OPEN_FOLDER, dir_fd=parent_fd)


def _give_rights(name: str, parent_fd: int | None) -> None:
    """Of the owner. Through a descriptor, because `chmod` would follow a link."""
    fd = os.open(name, os.O_PATH | os.O_NOFOLLOW | os.O_DIRECTORY | os.O_CLOEXEC, dir_fd=parent_fd)
    try:
        os.chmod(f"/proc/self/fd/{fd}", OWNER_ALL)  # noqa: PTH101 (a link to no path)
    finally:
        os.close(fd)
