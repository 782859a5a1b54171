"""A mistake in the pipeline."""


def preload() -> None:
    """Nothing to import."""


def needs_processes(task) -> bool:
    return False


def run(task, on_progress) -> None:
    raise ZeroDivisionError("secret of the implementation")
