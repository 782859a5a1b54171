"""The rows of uploaded meshes; their bytes are in `service.storage.blobs`."""

from collections.abc import Sequence
from contextlib import suppress

from sqlalchemy import func, select, update
from sqlalchemy.exc import IntegrityError

from service.jobs.models import DEFAULT_TENANT, BlobRow, JobRow
from service.jobs.table_access import TableAccess

ID_BATCH = 500  # of one statement: databases limit its parameters


class BlobRecords(TableAccess):
    """Meshes that tenants sent."""

    def add_blob(self, blob_id: str, size: int, mesh_format: str, tenant: str = DEFAULT_TENANT) -> None:
        """Add a stored blob. The same content again is the same blob with a new age."""
        row = BlobRow(tenant=tenant, id=blob_id, size=size, format=mesh_format, created_ms=self._clock_ms())
        with suppress(IntegrityError), self._session.begin() as session:  # sent twice at the same moment
            session.merge(row)

    def blob(self, blob_id: str, tenant: str = DEFAULT_TENANT) -> BlobRow | None:
        """The blob; None if the tenant did not send it."""
        if "\0" in blob_id:
            return None
        with self._session() as session:
            return session.get(BlobRow, (tenant, blob_id))

    def stored_bytes(self, tenant: str) -> int:
        """Bytes of the meshes and results of a tenant."""
        meshes = select(func.sum(BlobRow.size)).where(BlobRow.tenant == tenant)
        results = select(func.sum(JobRow.result_bytes)).where(JobRow.tenant == tenant)
        with self._session() as session:
            return int(session.scalar(meshes) or 0) + int(session.scalar(results) or 0)

    def touch_blobs(self, blob_ids: Sequence[str], tenant: str) -> set[str]:
        """`touch_blob` of many; returns those that the tenant has."""
        found: set[str] = set()
        with self._session.begin() as session:
            for first in range(0, len(blob_ids), ID_BATCH):
                some = blob_ids[first : first + ID_BATCH]
                done = session.scalars(
                    update(BlobRow)
                    .where(BlobRow.tenant == tenant, BlobRow.id.in_(some))
                    .values(created_ms=self._clock_ms())
                    .returning(BlobRow.id),
                    execution_options={"synchronize_session": False},
                )
                found |= set(done)
        return found

    def touch_blob(self, blob_id: str, tenant: str) -> bool:
        """Restart the age of a blob that a new job names; False if the tenant has no such blob."""
        with self._session.begin() as session:
            done = session.execute(
                update(BlobRow)
                .where(BlobRow.tenant == tenant, BlobRow.id == blob_id)
                .values(created_ms=self._clock_ms())
                .returning(BlobRow.id)
            )
            return done.scalar_one_or_none() is not None
