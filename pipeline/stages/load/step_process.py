"""STEP to GLB by Open CASCADE, in a process of its own.

A damaged file may make Open CASCADE follow a null pointer, which ends its process; and it prints what it
finds wrong. Both become errors here. This file is also the program of that process.
"""

import re
import signal
import subprocess
import sys
from pathlib import Path

#: Angle in radians between neighbouring triangles on a curved face; the default of Open CASCADE.
ANGLE_RAD = 0.5
#: `_IONBF` of stdio.h on Linux.
_UNBUFFERED = 2
_SYNTAX = re.compile(r"Undefined Parsing: Line (\d+): Incorrect syntax: ([^*\n]*)")
_SYNTAX_COUNT = re.compile(r"StepFile : Incorrect Syntax : Fails Count : (\d+)")
_UNRESOLVED = re.compile(r"Unresolved Reference : Fails Count : (\d+)")


def tessellated(step: bytes, tolerance_mm: float) -> bytes:
    """A GLB in metres, empty when there is nothing to tessellate; the same for the same bytes.

    Raises
    ------
    UnreadableFile
        With the line of a syntax error, or how many references lead nowhere.
    MemoryError
    """
    from pipeline.core.errors import UnreadableFile

    # the program is this file; no part of the STEP is in the command
    command = [sys.executable, "-I", str(Path(__file__)), repr(tolerance_mm)]
    done = subprocess.run(command, input=step, capture_output=True, check=False)  # noqa: S603
    messages = done.stderr.decode(errors="replace")
    if done.returncode == -signal.SIGKILL or "bad_alloc" in messages or "MemoryError" in messages:
        raise MemoryError("the tessellation of the STEP needs more memory than there is")
    if syntax := _SYNTAX.search(messages):
        line = max(int(syntax[1]) - 1, 1)  # it counts from 2
        raise UnreadableFile(
            f"the STEP has a syntax error at or before line {line}: {syntax[2].strip()[:200]}"
        )
    if syntax := _SYNTAX_COUNT.search(messages):
        raise UnreadableFile(f"the STEP has {syntax[1]} syntax errors")
    if unresolved := _UNRESOLVED.search(messages):
        raise UnreadableFile(
            f"the STEP is damaged: {unresolved[1]} of its entities refer to entities that are not in the file"
        )
    if done.returncode:
        raise UnreadableFile(f"the STEP is damaged: Open CASCADE fails on it ({_reason(done)})")
    return done.stdout


def _reason(done: "subprocess.CompletedProcess[bytes]") -> str:
    if done.returncode < 0:
        return signal.Signals(-done.returncode).name
    last = done.stderr.decode(errors="replace").strip().splitlines()
    return last[-1][:200] if last else f"code {done.returncode}"


def _main() -> None:
    import ctypes
    import os

    libc = ctypes.CDLL(None)  # messages are written at once: a crash would lose them
    libc.setvbuf(ctypes.c_void_p.in_dll(libc, "stdout"), None, _UNBUFFERED, ctypes.c_size_t(0))
    sys.modules["trimesh"] = None  # type: ignore[assignment]  # cascadio can do without, and starts at once
    import cascadio

    result = os.dup(1)
    os.dup2(2, 1)  # the messages of Open CASCADE
    glb = cascadio.load(
        sys.stdin.buffer.read(),
        tol_linear=float(sys.argv[1]),
        tol_angular=ANGLE_RAD,
        use_parallel=False,  # the same order, the same bytes
    )
    with os.fdopen(result, "wb") as out:
        out.write(glb)


if __name__ == "__main__":
    _main()
