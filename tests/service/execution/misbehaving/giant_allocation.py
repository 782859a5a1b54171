"""Asks for more than can be given, at once."""


def preload() -> None:
    """Nothing to import."""


def needs_processes(task) -> bool:
    return False


def run(task, on_progress) -> None:
    bytearray(1 << 45)
