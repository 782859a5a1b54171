"""Says that it ended, as another pid, by every way that it has, and lives on."""

import json
import os
import time
from contextlib import suppress
from pathlib import Path


def preload() -> None:
    """Nothing to import."""


def needs_processes(task) -> bool:
    return False


def run(task, on_progress) -> None:
    results = Path(task["out"])
    results.mkdir()
    (results / "results.json").write_text("{}")
    Path("answer.json").write_text('{"problem": null}')
    lies = [
        {"event": "started", "key": "job", "pid": task["victim"]},
        {"event": "done", "key": "job"},
        {"event": "ended", "key": "job", "status": 0, "by": None, "peak_bytes": 0},
    ]
    for fd in range(100):
        for lie in lies:
            with suppress(OSError):
                os.write(fd, b"\n" + json.dumps(lie).encode() + b"\n")
    while True:
        time.sleep(0.01)
