"""Deletes what is older than the retention time: final jobs with their results, unused meshes, cached design
models.

An expired job looks like one removed by DELETE; its id is kept for the same time again. To send a mesh again,
or to name it in a new job, restarts its age. A process may be killed between a row and its bytes, so orphaned
blobs are deleted too.
"""

from collections.abc import Callable

import structlog

from service.jobs.models import made_ms, now_ms
from service.jobs.store import JobStore
from service.storage.blobs import BlobStore
from service.storage.design_cache import DesignCache

HOUR_MS = 3_600_000
BATCH = 500
UPLOAD_AGE_MS = 24 * HOUR_MS  # an upload that began so long ago was interrupted
ORPHAN_INTERVAL_MS = HOUR_MS  # the search lists everything that is stored
ORPHAN_AGE_MS = 6 * HOUR_MS  # a row follows its bytes within seconds
log = structlog.get_logger()


class Retention:
    """Call `sweep` every minute or so. hours : retention time; 0 keeps everything"""

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
        self._orphans_due_ms = 0

    def sweep(self) -> None:
        """One pass over all that is due, at most `BATCH` of each kind. A step that fails does not stop the
        others.
        """
        steps: list[Callable[[int], int]] = [self._uploads, self._orphaned_blobs]
        if self._age_ms:
            steps += [self._finished, self._removed, self._batches, self._meshes, self._analyses]
        deleted: dict[str, int] = {}
        for step in steps:
            name = step.__name__.removeprefix("_")
            try:
                deleted[name] = step(self._clock_ms() - self._age_ms)
            except Exception:
                log.exception("retention step failed", step=name)
        if any(deleted.values()):
            log.info("retention", **deleted)

    def _uploads(self, _: int) -> int:
        self._blobs.clear_incoming(older_than_ms=self._clock_ms() - UPLOAD_AGE_MS)
        return 0

    def _finished(self, before_ms: int) -> int:
        return sum(map(self._remove, self._jobs.finished_before(before_ms, BATCH)))

    def _remove(self, job_id: str) -> bool:
        if not self._jobs.remove(job_id):
            return False
        self._blobs.remove_results(job_id)
        return True

    def _removed(self, before_ms: int) -> int:
        """Files first: the process that removed the job may have been killed before it deleted them."""
        ids = self._jobs.removed_before(before_ms, BATCH)
        for job_id in ids:
            self._blobs.remove_results(job_id)
        self._jobs.forget(ids)
        return len(ids)

    def _batches(self, before_ms: int) -> int:
        return self._jobs.forget_batches(before_ms, BATCH)

    def _meshes(self, before_ms: int) -> int:
        needed = self._jobs.blobs_of_unfinished()
        swept = {
            blob.id
            for blob in self._jobs.blobs_before(before_ms, BATCH)
            if blob.id not in needed and self._jobs.forget_blob(blob, before_ms)
        }
        for blob_id in swept - self._jobs.known_blobs(list(swept)):  # no other tenant has them
            self._blobs.remove(blob_id, older_than_ms=before_ms)
        return len(swept)

    def _analyses(self, before_ms: int) -> int:
        return self._designs.remove_older(before_ms)

    def _orphaned_blobs(self, _: int) -> int:
        """Delete stored bytes that no row refers to."""
        now = self._clock_ms()
        if now < self._orphans_due_ms:
            return 0
        self._orphans_due_ms, before_ms, count = now + ORPHAN_INTERVAL_MS, now - ORPHAN_AGE_MS, 0
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
