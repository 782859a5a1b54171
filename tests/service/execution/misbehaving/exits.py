"""Leaves without an answer."""

import os


def preload() -> None:
    """Nothing to import."""


def needs_processes(task) -> bool:
    return False


def run(task, on_progress) -> None:
    os._exit(7)
