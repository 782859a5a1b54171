"""A mistake in the pipeline."""


def preload() -> None:
    """Nothing to import."""


def run(task, on_progress) -> None:
    raise ZeroDivisionError("secret of the implementation")
