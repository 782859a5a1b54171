"""Does what the task says: another one of these, by its name."""

import importlib


def preload() -> None:
    """Nothing to import."""


def needs_processes(task) -> bool:
    return bool(importlib.import_module(task["misbehave"]).needs_processes(task))


def run(task, on_progress) -> None:
    importlib.import_module(task["misbehave"]).run(task, on_progress)
