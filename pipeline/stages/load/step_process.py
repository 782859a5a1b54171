"""STEP to GLB by Open CASCADE, in a process of its own.

A damaged file may make Open CASCADE follow a null pointer, which ends its process; and it prints what it
finds wrong. Both become errors here. This file is also the program of that process, which tessellates as
often as it is asked to: its start takes as long as a small part.
"""

import re
import signal
import struct
import subprocess
import sys
import threading
from contextlib import suppress
from pathlib import Path
from typing import IO

#: Angle in radians between neighbouring triangles on a curved face; the default of Open CASCADE.
ANGLE_RAD = 0.5
#: `_IONBF` of stdio.h on Linux.
_UNBUFFERED = 2
_SYNTAX = re.compile(r"Undefined Parsing: Line (\d+): Incorrect syntax: ([^*\n]*)")
_SYNTAX_COUNT = re.compile(r"StepFile : Incorrect Syntax : Fails Count : (\d+)")
_UNRESOLVED = re.compile(r"Unresolved Reference : Fails Count : (\d+)")
#: What the process runs; no part of the STEP is in its command.
PROGRAM = Path(__file__)
#: What goes to the process and comes back: a length and so many bytes, a tolerance.
_LENGTH, _TOLERANCE = struct.Struct("<Q"), struct.Struct("<d")


class Tessellation:
    """One STEP, tessellated with several tolerances; used with `with`, whose end tells what was wrong."""

    def __init__(self, step: bytes) -> None:
        command = [sys.executable, "-I", str(PROGRAM)]
        self._process = subprocess.Popen(  # noqa: S603
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE
        )
        # a pipe that nobody reads would stop the process; a job can write no file beside its own
        self._messages: list[bytes] = []
        self._reader = threading.Thread(target=self._read_messages, daemon=True)
        self._reader.start()
        self._step: bytes | None = step

    def __enter__(self) -> "Tessellation":
        return self

    def __exit__(self, *_: object) -> None:
        """Raise what Open CASCADE said of the file: the reason of whatever came of it.

        Raises
        ------
        UnreadableFile
            With the line of a syntax error, or how many references lead nowhere; or how the process ended.
        MemoryError
        """
        for stream in (self._process.stdin, self._process.stdout):
            if stream is not None:
                with suppress(BrokenPipeError):
                    stream.close()
        code = self._process.wait()  # it ends when nothing more can be asked
        self._reader.join()
        _check(code, b"".join(self._messages).decode(errors="replace"))

    def glb(self, tolerance_mm: float) -> bytes:
        """A GLB in metres, empty when there is nothing to tessellate; the same for the same bytes.

        Raises
        ------
        UnreadableFile
            When the process has ended; `__exit__` has the reason.
        """
        from pipeline.core.errors import UnreadableFile

        assert self._process.stdin is not None and self._process.stdout is not None  # noqa: S101 (for mypy)
        with suppress(BrokenPipeError):  # it has ended
            if self._step is not None:
                self._process.stdin.write(_LENGTH.pack(len(self._step)))
                self._process.stdin.write(self._step)
                self._step = None
            self._process.stdin.write(_TOLERANCE.pack(tolerance_mm))
            self._process.stdin.flush()
        found = _received(self._process.stdout)
        if found is None:
            raise UnreadableFile("the STEP is damaged: Open CASCADE ended")
        return found

    def _read_messages(self) -> None:
        if self._process.stderr is not None:
            with self._process.stderr as stream:
                self._messages.extend(iter(lambda: stream.read(65536), b""))


def _received(stream: IO[bytes]) -> bytes | None:
    """A length and so many bytes; None where the stream ends before."""
    head = stream.read(_LENGTH.size)
    if len(head) < _LENGTH.size:
        return None
    (length,) = _LENGTH.unpack(head)
    body = stream.read(length)
    return body if len(body) == length else None


def _check(code: int, messages: str) -> None:
    from pipeline.core.errors import UnreadableFile

    if code == -signal.SIGKILL or "bad_alloc" in messages or "MemoryError" in messages:
        raise MemoryError("the tessellation of the STEP needs more memory than there is")
    if syntax := _SYNTAX.search(messages):
        line = max(int(syntax[1]) - 1, 1)  # it counts from 2
        raise UnreadableFile(
            f"the STEP has a syntax error at or before line {line}: {syntax[2].strip()[:200]}"
        )
    if syntax := _SYNTAX_COUNT.search(messages):
        raise UnreadableFile(f"the STEP is damaged: syntax errors: {syntax[1]}")
    if unresolved := _UNRESOLVED.search(messages):
        raise UnreadableFile(
            f"the STEP is damaged: {unresolved[1]} of its entities refer to entities that are not in the file"
        )
    if code:
        raise UnreadableFile(f"the STEP is damaged: Open CASCADE fails on it ({_reason(code, messages)})")


def _reason(code: int, messages: str) -> str:
    if code < 0:
        return signal.Signals(-code).name
    last = messages.strip().splitlines()
    return last[-1][:200] if last else f"code {code}"


def _main() -> None:
    import ctypes
    import os

    libc = ctypes.CDLL(None)  # messages are written at once: a crash would lose them
    libc.setvbuf(ctypes.c_void_p.in_dll(libc, "stdout"), None, _UNBUFFERED, ctypes.c_size_t(0))
    sys.modules["trimesh"] = None  # type: ignore[assignment]  # cascadio can do without, and starts at once
    import cascadio

    result = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # the messages of Open CASCADE
    step = _received(sys.stdin.buffer)
    while step is not None and len(asked := sys.stdin.buffer.read(_TOLERANCE.size)) == _TOLERANCE.size:
        glb = cascadio.load(
            step,
            tol_linear=_TOLERANCE.unpack(asked)[0],
            tol_angular=ANGLE_RAD,
            use_parallel=False,  # the same order, the same bytes
            include_brep=True,
        )
        result.write(_LENGTH.pack(len(glb)))
        result.write(glb)
        result.flush()


if __name__ == "__main__":
    _main()
