"""Never lets another thread run: a regular expression that backtracks for ages holds the GIL in C."""

import re


def preload() -> None:
    """Nothing to import."""


def needs_processes(task) -> bool:
    return False


def run(task, on_progress) -> None:
    on_progress("geodesics", 5.0, "about to hang")
    re.match(r"(a+)+$", "a" * 64 + "b")
