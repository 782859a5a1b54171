"""Asks for more than can be given, at once."""


def preload() -> None:
    """Nothing to import."""


def run(task, on_progress) -> None:
    bytearray(1 << 45)
