"""Faults in native code."""

import ctypes


def preload() -> None:
    """Nothing to import."""


def needs_processes(task) -> bool:
    return False


def run(task, on_progress) -> None:
    on_progress("load", 1.0, "about to fault")
    ctypes.string_at(0)
