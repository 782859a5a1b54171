"""The limit of requests per second of one caller, in one API process."""

from limits import RateLimitItemPerSecond
from limits.storage import MemoryStorage
from limits.strategies import SlidingWindowCounterRateLimiter

from service.contract.errors import RateLimited


class Rates:
    """per_s : 0 for no limit. Safe to share between threads."""

    def __init__(self, per_s: int) -> None:
        self._per_s = per_s
        self._limiter = SlidingWindowCounterRateLimiter(MemoryStorage())
        self._item = RateLimitItemPerSecond(max(per_s, 1))

    def count(self, who: str) -> None:
        """Count a request. who : id of the key, or address of a caller without one. Raises RateLimited."""
        if self._per_s and not self._limiter.hit(self._item, who):
            raise RateLimited(f"more than {self._per_s} requests per second; send it again in 1 s")
