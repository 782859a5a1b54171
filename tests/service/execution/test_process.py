"""What the kernel is asked for, by what another process then sees."""

import ctypes
import os
import signal
from collections.abc import Callable
from pathlib import Path

import pytest

from service.execution.process import PR_SET_DUMPABLE, keep_secrets

NOBODY = 65_534


def open_to_all() -> None:
    """As after an exec: changing the user alone closes a process."""
    ctypes.CDLL(None).prctl(PR_SET_DUMPABLE, 1, 0, 0, 0)


def as_nobody(act: Callable[[], None]) -> int:
    """Pid of a fork that is an ordinary user and has done `act`, until it is killed; or exit code 1 of
    `act`.
    """
    read_end, write_end = os.pipe()
    pid = os.fork()
    if pid:
        os.close(write_end)
        os.read(read_end, 1)
        os.close(read_end)
        return pid
    try:
        if os.getuid() == 0:
            os.setgid(NOBODY)
            os.setuid(NOBODY)
        act()
        os.write(write_end, b"1")
        signal.pause()
    finally:
        os._exit(1)


@pytest.mark.parametrize(("prepare", "is_read"), [(open_to_all, True), (keep_secrets, False)])
def test_another_process_of_the_same_user_cannot_read_the_environment(
    prepare: Callable[[], None], is_read: bool
) -> None:
    owner = as_nobody(prepare)

    def read() -> None:
        Path(f"/proc/{owner}/environ").read_bytes()

    reader = as_nobody(read)
    try:
        os.kill(reader, signal.SIGTERM)
        _, status = os.waitpid(reader, 0)
        assert os.WIFSIGNALED(status) == is_read, "read, then waited for the signal; or failed at reading"
    finally:
        os.kill(owner, signal.SIGKILL)
        os.waitpid(owner, 0)
