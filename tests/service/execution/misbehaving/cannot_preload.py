"""A system library is missing."""


def preload() -> None:
    raise RuntimeError("libopengl0 is missing: apt-get install libopengl0")


def run(task, on_progress) -> None:
    raise AssertionError
