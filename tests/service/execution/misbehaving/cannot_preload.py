"""A system library is missing."""


def preload() -> None:
    raise RuntimeError("libopengl0 is missing: apt-get install libopengl0")


def needs_processes(task) -> bool:
    return False


def run(task, on_progress) -> None:
    raise AssertionError
