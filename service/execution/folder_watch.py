"""Looks at the size of a job's folder in a thread of its own.

Code of an attacker can delay a look, by changing the folder all the time. The clock of the job must not wait
for it.
"""

from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path

from service.execution.folder_size import used_bytes

#: A look that has not ended after so many polls was delayed by the job: it takes milliseconds. Counted in
#: polls, not by a clock, since a worker that was paused for a while has missed nothing.
MAX_POLLS = 50


class FolderWatch:
    """Of one job. limit_bytes : of the folder"""

    def __init__(self, folder: Path, limit_bytes: int) -> None:
        self._folder, self._limit_bytes = folder, limit_bytes
        self._thread = ThreadPoolExecutor(1, thread_name_prefix="folder")
        self._look: Future[int] | None = None
        self._polls = 0

    def is_over(self, pid: int | None) -> bool:
        """Whether the last look found more than the limit, or takes too long; starts the next. Returns at
        once.
        """
        if self._look is not None and not self._look.done():
            self._polls += 1
            return self._polls > MAX_POLLS
        was_over = self._look is not None and self._look.result() > self._limit_bytes
        self._look, self._polls = self._thread.submit(used_bytes, self._folder, pid), 0
        return was_over

    def is_over_at_the_end(self) -> bool:
        """The same of a job whose processes have ended: nobody changes the folder any more."""
        return used_bytes(self._folder, None) > self._limit_bytes

    def close(self) -> None:
        """Wait for no look."""
        self._thread.shutdown(wait=False, cancel_futures=True)
