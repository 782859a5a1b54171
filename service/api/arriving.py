"""How many bytes each tenant is sending at this moment to this process: a quota counts them too."""

import threading
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager


class Arriving:
    """Safe to share between threads."""

    def __init__(self) -> None:
        self._bytes: Counter[str] = Counter()
        self._lock = threading.Lock()

    def of(self, tenant: str) -> int:
        """Bytes that arrived in uploads that have not ended."""
        with self._lock:
            return self._bytes[tenant]

    @contextmanager
    def upload(self, tenant: str) -> Iterator["ArrivingUpload"]:
        """One upload, until the end of the block."""
        mine = ArrivingUpload(self, tenant)
        try:
            yield mine
        finally:
            self.add(tenant, -mine.size)

    def add(self, tenant: str, size: int) -> None:
        """Count `size` more bytes."""
        with self._lock:
            self._bytes[tenant] += size


class ArrivingUpload:
    """size : bytes so far"""

    def __init__(self, arriving: Arriving, tenant: str) -> None:
        self._arriving, self._tenant = arriving, tenant
        self.size = 0

    def grow(self, size: int) -> None:
        """Count `size` more bytes."""
        self._arriving.add(self._tenant, size)
        self.size += size
