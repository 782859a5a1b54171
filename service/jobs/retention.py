"""What is old enough goes: final jobs with their results, meshes that no unfinished job needs, and kept analyses of designs.

A job is gone like one that was removed by DELETE; its id stays known for as long again. Sending a mesh or naming it in a
new job makes it new. A process may be killed between a row and its bytes, so bytes without a row are looked for as well.
"""

from collections.abc import Callable

import structlog

from service.jobs.models import made_ms, now_ms
from service.jobs.store import JobStore
from service.storage.blobs import BlobStore
from service.storage.design_cache import DesignCache

HOUR_MS = 3_600_000
BATCH = 500
CUT_OFF_MS = 24 * HOUR_MS  # an upload that began so long ago was cut off
STRAY_INTERVAL_MS = HOUR_MS  # it lists everything that is stored
STRAY_AGE_MS = 6 * HOUR_MS  # a row follows its bytes within seconds
log = structlog.get_logger()


class Retention:
    """Call `sweep` now and then. hours : 0 keeps everything"""

    def __init__(
        self,
        jobs: JobStore,
        blobs: BlobStore,
        designs: DesignCache,
        hours: float,
        clock_ms: Callable[[], int] = now_ms,
    ) -> None:
        self._jobs, self._blobs, self._designs = jobs, blobs, designs
        self._age_ms, self._clock_ms = int(hours * HOUR_MS), clock_ms
        self._strays_due_ms = 0

    def sweep(self) -> None:
        """Once over everything that is due, at most `BATCH` of each kind. What cannot be done now holds up nothing else."""
        steps: list[Callable[[int], int]] = [self._uploads, self._strays]
        if self._age_ms:
            steps += [self._finished, self._removed, self._meshes, self._analyses]
        gone: dict[str, int] = {}
        for step in steps:
            name = step.__name__.removeprefix("_")
            try:
                gone[name] = step(self._clock_ms() - self._age_ms)
            except Exception:
                log.exception("retention waits", step=name)
        if any(gone.values()):
            log.info("retention", **gone)

    def _uploads(self, _: int) -> int:
        self._blobs.clear_incoming(older_than_ms=self._clock_ms() - CUT_OFF_MS)
        return 0

    def _finished(self, before_ms: int) -> int:
        return sum(map(self._remove, self._jobs.finished_before(before_ms, BATCH)))

    def _remove(self, job_id: str) -> bool:
        if not self._jobs.remove(job_id):
            return False
        self._blobs.remove_results(job_id)
        return True

    def _removed(self, before_ms: int) -> int:
        """Files first: whoever removed the job may have been killed before them, and no row would name them any more."""
        ids = self._jobs.removed_before(before_ms, BATCH)
        for job_id in ids:
            self._blobs.remove_results(job_id)
        self._jobs.forget(ids)
        return len(ids)

    def _meshes(self, before_ms: int) -> int:
        needed = self._jobs.blobs_of_unfinished()
        swept = {
            blob.id
            for blob in self._jobs.blobs_before(before_ms, BATCH)
            if blob.id not in needed and self._jobs.forget_blob(blob, before_ms)
        }
        for blob_id in swept - self._jobs.known_blobs(list(swept)):  # of no other tenant either
            self._blobs.remove(blob_id, older_than_ms=before_ms)
        return len(swept)

    def _analyses(self, before_ms: int) -> int:
        return self._designs.remove_older(before_ms)

    def _strays(self, _: int) -> int:
        """Bytes that no row names."""
        now = self._clock_ms()
        if now < self._strays_due_ms:
            return 0
        self._strays_due_ms, before_ms, count = now + STRAY_INTERVAL_MS, now - STRAY_AGE_MS, 0
        needed = self._jobs.blobs_of_unfinished()
        for stored in self._blobs.stored(older_than_ms=before_ms):
            for blob_id in set(stored) - self._jobs.known_blobs(stored) - needed:
                self._blobs.remove(blob_id, older_than_ms=before_ms)
                count += 1
        old = [each for each in self._blobs.jobs_with_results() if (made_ms(each) or now) < before_ms]
        for first in range(0, len(old), BATCH):
            some = old[first : first + BATCH]
            for job_id in set(some) - self._jobs.known_jobs(some):
                self._blobs.remove_results(job_id)
                count += 1
        return count
