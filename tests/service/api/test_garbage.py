"""Old objects are looked at once, then only at long intervals: collections of garbage stay short."""

import gc
import weakref
from collections.abc import Iterator

import pytest

from service.api.garbage import FULL_INTERVAL_S, SettledObjects


class Loop:
    """Garbage that only the collector can free, once nobody holds it."""

    def __init__(self) -> None:
        self.itself = self


@pytest.fixture
def clock() -> Iterator[list[float]]:
    now = [0.0]
    settled = SettledObjects(lambda: now[0])
    gc.callbacks.append(settled)
    yield now
    gc.callbacks.remove(settled)
    gc.unfreeze()


def test_a_cycle_among_settled_objects_is_freed_by_the_next_full_look(clock: list[float]) -> None:
    loop = Loop()
    gone = weakref.ref(loop)
    gc.collect()  # it is in use, so it is set aside
    del loop
    gc.collect()
    assert gone() is not None  # a look at what is new only
    clock[0] = FULL_INTERVAL_S
    gc.collect()
    assert gone() is None


def test_a_cycle_among_new_objects_is_freed_at_once(clock: list[float]) -> None:
    gone = weakref.ref(Loop())
    gc.collect()
    assert gone() is None
