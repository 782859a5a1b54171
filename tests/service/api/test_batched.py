"""One look-up answers all requests of the moment, and none with an older state."""

import asyncio
import threading
from collections.abc import Sequence

import pytest

from service.api.batched import Batched


def test_requests_of_a_moment_share_a_look_up() -> None:
    """The first runs alone; those that come meanwhile are the second, whatever their number."""
    asked: list[list[str]] = []
    have_come = threading.Event()

    def load(keys: Sequence[str]) -> dict[str, int]:
        asked.append(sorted(keys))
        assert have_come.wait(30)
        return {key: len(asked) for key in keys if key != "unknown"}

    async def run() -> list[int | None]:
        batched = Batched(load)
        first = asyncio.create_task(batched.get("a"))
        while not asked:
            await asyncio.sleep(0.001)
        others = [asyncio.create_task(batched.get(key)) for key in ("a", "b", "b", "unknown")]
        await asyncio.sleep(0)  # now they wait
        have_come.set()
        return [*await asyncio.gather(*others), await first]

    assert asyncio.run(run()) == [2, 2, 2, None, 1]
    assert asked == [["a"], ["a", "b", "unknown"]]


def test_what_fails_for_one_fails_for_that_one() -> None:
    def load(keys: Sequence[str]) -> dict[str, str]:
        if "bad" in keys:
            raise ValueError("a row that cannot be read")
        return {key: key for key in keys}

    async def run() -> list[object]:
        batched = Batched(load)
        return list(
            await asyncio.gather(*(batched.get(key) for key in ("a", "bad", "b")), return_exceptions=True)
        )

    first, failed, last = asyncio.run(run())
    assert (first, last) == ("a", "b")
    with pytest.raises(ValueError, match="cannot be read"):
        raise failed  # type: ignore[misc]


def test_a_request_that_gave_up_hinders_nobody() -> None:
    async def run() -> int | None:
        batched = Batched(lambda keys: dict.fromkeys(keys, 1))
        gone, waiting = (asyncio.create_task(batched.get("a")) for _ in range(2))
        await asyncio.sleep(0)
        gone.cancel()
        return await waiting

    assert asyncio.run(run()) == 1
