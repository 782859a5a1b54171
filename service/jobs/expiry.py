"""What retention asks the tables: which jobs and meshes are old, and which of them are still needed."""

import re
from collections.abc import Sequence

from sqlalchemy import Text, cast, delete, select

from service.contract.schemas import Status
from service.jobs.batches import BatchRow
from service.jobs.deliveries import DeliveryRow
from service.jobs.models import BlobRow, IdempotencyRow, JobRow
from service.jobs.table_access import TableAccess

BLOB_ID = re.compile(r"sha256:[0-9a-f]{64}")


class ExpiryQueries(TableAccess):
    """Old rows and their deletion."""

    def finished_before(self, before_ms: int, limit: int) -> Sequence[str]:
        """Ids of jobs that ended before `before_ms` and were not removed, oldest first."""
        final = [status for status in Status if status.is_final]
        query = select(JobRow.id).where(
            JobRow.status.in_(final), JobRow.removed_ms.is_(None), JobRow.finished_ms < before_ms
        )
        with self._session() as session:
            return session.scalars(query.order_by(JobRow.id).limit(limit)).all()

    def removed_before(self, before_ms: int, limit: int) -> Sequence[str]:
        """Ids of jobs that were removed before `before_ms`, oldest first."""
        query = select(JobRow.id).where(JobRow.removed_ms < before_ms)
        with self._session() as session:
            return session.scalars(query.order_by(JobRow.id).limit(limit)).all()

    def forget(self, removed: Sequence[str]) -> None:
        """Delete the rows of removed jobs."""
        with self._session.begin() as session:
            session.execute(delete(IdempotencyRow).where(IdempotencyRow.job_id.in_(removed)))
            session.execute(delete(DeliveryRow).where(DeliveryRow.job_id.in_(removed)))
            session.execute(delete(JobRow).where(JobRow.id.in_(removed), JobRow.removed_ms.is_not(None)))

    def forget_batches(self, before_ms: int, limit: int) -> int:
        """Delete batches that ended before `before_ms` and have no job any more; returns their number."""
        of_batch = select(JobRow.id).where(JobRow.batch_id == BatchRow.id)
        query = select(BatchRow.id).where(BatchRow.finished_ms < before_ms, ~of_batch.exists())
        with self._session.begin() as session:
            old = session.scalars(query.limit(limit)).all()
            session.execute(delete(IdempotencyRow).where(IdempotencyRow.job_id.in_(old)))
            session.execute(delete(DeliveryRow).where(DeliveryRow.job_id.in_(old)))
            session.execute(delete(BatchRow).where(BatchRow.id.in_(old)))
        return len(old)

    def known_jobs(self, job_ids: Sequence[str]) -> set[str]:
        """The ids that have a row, removed jobs included."""
        with self._session() as session:
            return set(session.scalars(select(JobRow.id).where(JobRow.id.in_(job_ids))))

    def blobs_of_unfinished(self) -> set[str]:
        """Ids of the meshes that waiting and running jobs need. Read as text: damaged rows count too."""
        query = select(cast(JobRow.inputs, Text)).where(JobRow.status.in_([Status.ACCEPTED, Status.RUNNING]))
        with self._session() as session:
            return {blob_id for inputs in session.scalars(query) for blob_id in BLOB_ID.findall(inputs or "")}

    def blobs_before(self, before_ms: int, limit: int) -> Sequence[BlobRow]:
        """Blobs that were last sent or named before `before_ms`, oldest first."""
        query = select(BlobRow).where(BlobRow.created_ms < before_ms)
        with self._session() as session:
            return session.scalars(query.order_by(BlobRow.created_ms, BlobRow.id).limit(limit)).all()

    def forget_blob(self, blob: BlobRow, before_ms: int) -> bool:
        """Delete the tenant's row; False if the blob was sent or named again meanwhile."""
        with self._session.begin() as session:
            done = session.execute(
                delete(BlobRow)
                .where(BlobRow.tenant == blob.tenant, BlobRow.id == blob.id, BlobRow.created_ms < before_ms)
                .returning(BlobRow.id)
            )
            return done.scalar_one_or_none() is not None

    def known_blobs(self, blob_ids: Sequence[str]) -> set[str]:
        """The ids that any tenant has."""
        with self._session() as session:
            return set(session.scalars(select(BlobRow.id).where(BlobRow.id.in_(blob_ids))))
