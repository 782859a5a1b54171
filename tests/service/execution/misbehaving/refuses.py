"""A mesh that cannot be used, as the pipeline says it."""

from pipeline.core.errors import TruncatedFile


def preload() -> None:
    """Nothing to import."""


def needs_processes(task) -> bool:
    return False


def run(task, on_progress) -> None:
    raise TruncatedFile("the file ends in the middle of a triangle", mesh="scan")
