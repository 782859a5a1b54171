"""Periodic tasks of a worker: each has a thread, so that one that hangs delays no other."""

import threading
from collections.abc import Callable
from dataclasses import dataclass

import structlog

log = structlog.get_logger()


@dataclass(frozen=True, slots=True)
class PeriodicTask:
    """after_error_s : added to the pause `every_s` when the call raised"""

    name: str
    call: Callable[[], None]
    every_s: float
    after_error_s: float = 0.0

    def begin(self, stop: threading.Event) -> threading.Thread:
        """Call now, and repeat until `stop` is set."""
        thread = threading.Thread(target=self._run, args=(stop,), name=self.name, daemon=True)
        thread.start()
        return thread

    def _run(self, stop: threading.Event) -> None:
        while not stop.is_set():
            pause_s = self.every_s
            try:
                self.call()
            except Exception:  # most likely the database is unavailable: the next call repeats the work
                log.exception("periodic task failed", task=self.name)
                pause_s += self.after_error_s
            stop.wait(pause_s)
