"""Progress of a job, from its process to the worker: JSON lines in a pipe that carries nothing else.

The process may be in the hands of an attacker: what is no progress message of this program is dropped, and
however much it writes, the worker spends little time on it.
"""

import json
import math
import os
import time
from collections.abc import Iterator
from contextlib import suppress

from pipeline import Stage

MIN_PROGRESS_INTERVAL_S = 0.05
CHUNK_BYTES = 64 * 1024  # the capacity of a pipe
MAX_LINE_BYTES = 4096  # of a message; a write of up to PIPE_BUF bytes is whole or not at all
MAX_LINES = 32  # of one chunk that are looked at, the newest; a process of ours sends 20 in a second
MAX_MESSAGE = 500  # characters, as the column in the database
STAGES = frozenset(stage.value for stage in Stage)


class ProgressWriter:
    """The end of the job's process. Never waits: what finds no room is dropped, since newer follows."""

    def __init__(self, fd: int) -> None:
        self._fd = fd
        self._stage = ""
        self._sent_at = 0.0
        os.set_blocking(fd, False)

    def send(self, stage: str, percent: float, message: str) -> None:
        """Send each new stage; within a stage at most one message every MIN_PROGRESS_INTERVAL_S."""
        now = time.monotonic()
        if stage == self._stage and now - self._sent_at < MIN_PROGRESS_INTERVAL_S:
            return
        self._stage, self._sent_at = stage, now
        line = json.dumps([stage, percent, message[:MAX_MESSAGE]]).encode() + b"\n"
        with suppress(BlockingIOError, BrokenPipeError):
            os.write(self._fd, line)


class ProgressReader:
    """The worker's end."""

    def __init__(self, fd: int) -> None:
        self.fd = fd
        self._partial = b""
        self.is_closed = False  # every process that could write has ended
        os.set_blocking(fd, False)

    def read(self) -> Iterator[tuple[str, float, str]]:
        """The messages that are there (stage, percent in [0, 100], text), of at most CHUNK_BYTES."""
        try:
            chunk = os.read(self.fd, CHUNK_BYTES)
        except BlockingIOError:
            return
        self.is_closed = not chunk
        *lines, self._partial = (self._partial + chunk).split(b"\n")
        self._partial = self._partial[-MAX_LINE_BYTES:]
        for line in lines[-MAX_LINES:]:
            if (message := _message(line)) is not None:
                yield message


def _message(line: bytes) -> tuple[str, float, str] | None:
    if len(line) > MAX_LINE_BYTES:
        return None
    try:
        stage, percent, text = json.loads(line)
        text.encode()  # half of a surrogate pair is text to JSON, and to no database
        percent = float(percent)
    except (ValueError, TypeError, AttributeError, RecursionError, OverflowError):
        return None
    if not isinstance(stage, str) or stage not in STAGES or not isinstance(text, str):
        return None
    if not math.isfinite(percent):
        return None
    return stage, min(max(percent, 0.0), 100.0), text[:MAX_MESSAGE].replace("\0", "")
