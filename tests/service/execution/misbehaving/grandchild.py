"""Leaves a child in its own group and a daemon in a session of its own behind."""

import json
import os
import subprocess
import time
from pathlib import Path


def preload() -> None:
    """Nothing to import."""


def needs_processes(task) -> bool:
    return True


def run(task, on_progress) -> None:
    plain = subprocess.Popen(["sleep", "600"])
    try:
        daemon = subprocess.Popen(["sleep", "600"], start_new_session=True)
    except PermissionError:  # where system calls are filtered
        daemon = subprocess.Popen(["sleep", "600"])
    Path(task["folder"], "pids.json").write_text(json.dumps([plain.pid, daemon.pid]))
    while task.get("stay"):
        time.sleep(0.01)
    os._exit(0)
