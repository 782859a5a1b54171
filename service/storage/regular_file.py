"""Opens a file that the process of a job left, once: what is checked is what is read."""

import os
import stat
from io import BufferedReader
from pathlib import Path


def open_regular_file(path: Path) -> BufferedReader | None:
    """The file, open for reading; None if it is none, or no regular one.

    A link could lead to any file of this user, also one that takes the place of a file after a check, and
    opening a named pipe could wait forever.
    """
    try:
        fd = os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC)
    except OSError:
        return None
    if not stat.S_ISREG(os.fstat(fd).st_mode):
        os.close(fd)
        return None
    return os.fdopen(fd, "rb")
