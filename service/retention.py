"""What is old enough goes: final jobs with their results, and meshes that no unfinished job needs.

A job is gone like one that was removed by DELETE; its id stays known for as long again. Sending a mesh or naming it in a
new job makes it new.
"""

from collections.abc import Callable

import structlog

from service.blobs import BlobStore
from service.job_store import JobStore
from service.jobs import now_ms

HOUR_MS = 3_600_000
BATCH = 500
CUT_OFF_MS = 24 * HOUR_MS  # an upload that began so long ago was cut off
log = structlog.get_logger()


class Retention:
    """Call `sweep` now and then. hours : 0 keeps everything"""

    def __init__(self, jobs: JobStore, blobs: BlobStore, hours: float, clock_ms: Callable[[], int] = now_ms) -> None:
        self._jobs, self._blobs, self._age_ms, self._clock_ms = jobs, blobs, int(hours * HOUR_MS), clock_ms

    def sweep(self) -> None:
        """Once over everything that is due, at most `BATCH` of each kind."""
        self._blobs.clear_incoming(older_than_ms=self._clock_ms() - CUT_OFF_MS)
        if not self._age_ms:
            return
        before_ms = self._clock_ms() - self._age_ms
        removed = [job_id for job_id in self._jobs.finished_before(before_ms, BATCH) if self._remove(job_id)]
        forgotten = self._jobs.forget_removed(before_ms, BATCH)
        needed = self._jobs.blobs_of_unfinished()
        swept = [
            blob.id
            for blob in self._jobs.blobs_before(before_ms, BATCH)
            if blob.id not in needed and self._jobs.forget_blob(blob, before_ms)
        ]
        for blob_id in set(swept):
            if not self._jobs.has_blob(blob_id):  # of no other tenant either
                self._blobs.remove(blob_id, older_than_ms=before_ms)
        if removed or swept or forgotten:
            log.info("retention", jobs_removed=len(removed), blobs_removed=len(swept), jobs_forgotten=forgotten)

    def _remove(self, job_id: str) -> bool:
        if not self._jobs.remove(job_id):
            return False
        self._blobs.remove_results(job_id)
        return True
