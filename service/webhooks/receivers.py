"""Turns between the receivers of messages and between tenants: none takes all senders, and a receiver that
fails is left alone for a while.

A circuit breaker: after FAILURES_TO_OPEN failed attempts in a row nothing is sent to a receiver for a pause
that doubles with each further failure; then one message at a time, until one is accepted. Its messages stay
due, and the pause costs none of their attempts.
"""

import threading
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field

MAX_PER_RECEIVER = 2  # messages that are sent to one receiver at the same time
SENDERS = 8  # messages that are sent at the same time,
MAX_PER_TENANT = SENDERS - 1  # and of one tenant: a place stays for the others
FAILURES_TO_OPEN = 5
FIRST_PAUSE_S = 30.0
MAX_PAUSE_S = 600.0


@dataclass(slots=True)
class _Receiver:
    in_flight: int = 0
    failures: int = 0  # in a row
    open_until: float = 0.0


@dataclass
class Receivers:
    """What one sender knows of its receivers. Safe to share between threads."""

    clock: Callable[[], float] = time.monotonic
    _known: dict[str, _Receiver] = field(default_factory=dict)
    _of_tenant: Counter[str] = field(default_factory=Counter)  # in flight
    _lock: threading.Lock = field(default_factory=threading.Lock)

    def without_room(self) -> list[str]:
        """The receivers that get no message now."""
        with self._lock:
            return [name for name in self._known if self._room(name) <= 0]

    def room(self, name: str) -> int:
        """How many more messages may be sent to the receiver now."""
        with self._lock:
            return self._room(name)

    def tenant_room(self, tenant: str) -> int:
        """How many more messages may be sent for the tenant now."""
        with self._lock:
            return MAX_PER_TENANT - self._of_tenant[tenant]

    def begin(self, name: str, tenant: str) -> None:
        """Take a place for one message."""
        with self._lock:
            self._of_tenant[tenant] += 1
            self._known.setdefault(name, _Receiver()).in_flight += 1

    def end(self, name: str, tenant: str, *, is_failure: bool) -> None:
        """Give the place back, and note how the attempt ended."""
        with self._lock:
            self._of_tenant[tenant] -= 1
            known = self._known[name]
            known.in_flight -= 1
            known.failures = known.failures + 1 if is_failure else 0
            beyond = known.failures - FAILURES_TO_OPEN
            if beyond >= 0:
                known.open_until = self.clock() + min(FIRST_PAUSE_S * 2.0 ** min(beyond, 30), MAX_PAUSE_S)
            if known.in_flight == 0 and known.failures == 0:
                del self._known[name]

    def _room(self, name: str) -> int:
        known = self._known.get(name)
        if known is None:
            return MAX_PER_RECEIVER
        if known.failures < FAILURES_TO_OPEN:
            return MAX_PER_RECEIVER - known.in_flight
        return 0 if self.clock() < known.open_until else 1 - known.in_flight
