"""Looks up for many requests at once: what they ask for while one look-up runs is the next one.

A request that asked the database by itself costs a turn of a thread and a query; both cost more than what is
found. The look-up that answers a request always begins after the request: nobody gets an older state.
"""

import asyncio
from collections.abc import Callable, Mapping, Sequence
from typing import Generic, TypeVar

from fastapi.concurrency import run_in_threadpool

K = TypeVar("K")
V = TypeVar("V")


class Batched(Generic[K, V]):
    """Of one event loop. load : is called in a thread, by one thread at a time; keys that it does not return
    are None
    """

    def __init__(self, load: Callable[[Sequence[K]], Mapping[K, V]]) -> None:
        self._load = load
        self._waiting: dict[K, list[asyncio.Future[V | None]]] = {}
        self._task: asyncio.Task[None] | None = None

    async def get(self, key: K) -> V | None:
        """What was found. Raises what `load` raised for this key."""
        found: asyncio.Future[V | None] = asyncio.get_running_loop().create_future()
        self._waiting.setdefault(key, []).append(found)
        if self._task is None or self._task.done():
            self._task = asyncio.create_task(self._run())
        return await found

    async def _run(self) -> None:
        while self._waiting:
            waiting, self._waiting = self._waiting, {}
            await self._answer(waiting)

    async def _answer(self, waiting: Mapping[K, Sequence["asyncio.Future[V | None]"]]) -> None:
        try:
            found = await run_in_threadpool(self._load, list(waiting))
        except Exception as error:
            if len(waiting) > 1:  # of one key, perhaps: the others are not to blame
                for key, futures in waiting.items():
                    await self._answer({key: futures})
                return
            for future in (each for futures in waiting.values() for each in futures if not each.done()):
                future.set_exception(error)
            return
        for key, futures in waiting.items():
            for future in futures:
                if not future.done():  # its request was cancelled
                    future.set_result(found.get(key))
