"""Collections of garbage that do not stop the API for long while thousands of clients watch.

CPython 3.11 to 3.13 collect the oldest generation all at once, and again after each 70,000 objects that were
made and are still there: with 2,000 event streams open each such look takes 100 ms and more, in which no
request is answered, and finds next to nothing. Here an object is looked at once when it is old, and set aside
(`gc.freeze`); everything is looked at again after FULL_INTERVAL_S. What reference counting frees, which is
nearly all, is freed at once in any case.
"""

import gc
import time
from collections.abc import Callable
from typing import Any

OLDEST = 2  # generation
#: Between two looks at all objects. Cycles among objects that are set aside live no longer than that, if
#: requests come; a look of 0.2 s every minute delays 0.3 % of the requests.
FULL_INTERVAL_S = 60.0


class SettledObjects:
    """A callback of `gc.callbacks`. clock : monotonic, in seconds"""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._full_at = clock() + FULL_INTERVAL_S

    def __call__(self, phase: str, info: dict[str, Any]) -> None:
        """Before and after each collection."""
        if info["generation"] != OLDEST:
            return
        if phase == "stop":
            gc.freeze()
        elif (now := self._clock()) >= self._full_at:
            self._full_at = now + FULL_INTERVAL_S
            gc.unfreeze()


def settle_objects() -> None:
    """From now on, in this process. Sets aside what there is."""
    gc.collect()
    gc.freeze()
    gc.callbacks.append(SettledObjects())
