"""What a worker does beside its jobs: each chore in a thread of its own, so that one that fails or hangs holds up no other."""

import threading
from collections.abc import Callable
from dataclasses import dataclass

import structlog

log = structlog.get_logger()


@dataclass(frozen=True, slots=True)
class Chore:
    """after_error_s : how much longer than `every_s` to wait when it failed"""

    name: str
    act: Callable[[], None]
    every_s: float
    after_error_s: float = 0.0

    def begin(self, stop: threading.Event) -> threading.Thread:
        """Now, and again and again until `stop`."""
        thread = threading.Thread(target=self._run, args=(stop,), name=self.name, daemon=True)
        thread.start()
        return thread

    def _run(self, stop: threading.Event) -> None:
        while not stop.is_set():
            pause_s = self.every_s
            try:
                self.act()
            except Exception:
                log.exception(
                    "not done", chore=self.name
                )  # a database that is away, most likely; the next time does it
                pause_s += self.after_error_s
            stop.wait(pause_s)
