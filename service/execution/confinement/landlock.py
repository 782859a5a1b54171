"""Landlock: a process gives up access to files, TCP and signals, for itself and what it starts, for good.

There is no wrapper in libc: the three system calls are made by number, which is the same on all architectures
(https://docs.kernel.org/userspace-api/landlock.html).
"""

import ctypes
import os
import stat
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path

_CREATE_RULESET, _ADD_RULE, _RESTRICT_SELF = 444, 445, 446
_VERSION_FLAG = 1
_RULE_PATH_BENEATH = 1

EXECUTE, WRITE_FILE, READ_FILE, READ_DIR = 1 << 0, 1 << 1, 1 << 2, 1 << 3
REMOVE_FILE, MAKE_DIR, MAKE_REG = 1 << 5, 1 << 7, 1 << 8
MAKE_FIFO, MAKE_SYM = 1 << 10, 1 << 12
TRUNCATE, IOCTL_DEV = 1 << 14, 1 << 15
#: Access rights to files that each version of Landlock knows, by version.
_KNOWN = {1: (1 << 13) - 1, 2: (1 << 14) - 1, 3: (1 << 15) - 1, 5: (1 << 16) - 1}
_OF_FILES = EXECUTE | WRITE_FILE | READ_FILE | TRUNCATE | IOCTL_DEV
_NETWORK = (4, 0b11)  # from version 4: bind and connect of TCP
_SCOPES = (6, 0b11)  # from version 6: abstract sockets and signals stay within the job

READ = READ_FILE | READ_DIR
RUN = READ | EXECUTE
DEVICE = READ_FILE | WRITE_FILE
#: Of a job in its own folder. No sockets and devices are made there. Folders stay where they are (no right
#: to remove one, which a rename needs too), and nothing moves from one to another (REFER): the size of what
#: is in folders that move all the time cannot be told.
OWN = READ | WRITE_FILE | TRUNCATE | REMOVE_FILE | MAKE_DIR | MAKE_REG | MAKE_FIFO | MAKE_SYM


class _Ruleset(ctypes.Structure):
    _fields_ = (("files", ctypes.c_uint64), ("network", ctypes.c_uint64), ("scopes", ctypes.c_uint64))


class _PathBeneath(ctypes.Structure):
    _pack_ = 1
    _fields_ = (("access", ctypes.c_uint64), ("fd", ctypes.c_int32))


def version() -> int:
    """The version (ABI) of Landlock of this kernel; 0 where there is none or it is not allowed."""
    answer: int = _libc().syscall(_CREATE_RULESET, None, ctypes.c_size_t(0), _VERSION_FLAG)
    return max(0, answer)


def restrict(allowed: Iterable[tuple[Path, int]]) -> None:
    """Give up all access that is not in `allowed` (path, rights at and below it); paths that do not exist are
    left out.

    `no_new_privs` must be set. Raises OSError where the kernel has no Landlock.
    """
    has = version()
    known = max((rights for since, rights in _KNOWN.items() if since <= has), default=0)
    ruleset = _Ruleset(known, *(what if has >= since else 0 for since, what in (_NETWORK, _SCOPES)))
    fd = _call(_CREATE_RULESET, ctypes.byref(ruleset), ctypes.c_size_t(ctypes.sizeof(ruleset)), 0)
    try:
        for path, rights in allowed:
            with suppress(FileNotFoundError, PermissionError, NotADirectoryError):
                _allow(fd, path, rights & known)
        _call(_RESTRICT_SELF, fd, 0)
    finally:
        os.close(fd)


def _allow(ruleset_fd: int, path: Path, rights: int) -> None:
    fd = os.open(path, os.O_PATH | os.O_CLOEXEC)
    try:
        if not stat.S_ISDIR(os.fstat(fd).st_mode):
            rights &= _OF_FILES
        rule = _PathBeneath(rights, fd)
        _call(_ADD_RULE, ruleset_fd, _RULE_PATH_BENEATH, ctypes.byref(rule), 0)
    finally:
        os.close(fd)


def _call(number: int, *arguments: object) -> int:
    libc = _libc()
    result: int = libc.syscall(number, *arguments)
    if result < 0:
        raise OSError(ctypes.get_errno(), f"Landlock is refused (system call {number})")
    return result


def _libc() -> ctypes.CDLL:
    return ctypes.CDLL(None, use_errno=True)
