"""Jobs in the database: stored once, found, listed and counted."""

from collections.abc import Iterator, Mapping, Sequence

import structlog
from sqlalchemy import String, func, select, type_coerce
from sqlalchemy.exc import DBAPIError, IntegrityError

from service.contract.schemas import JobType, Status
from service.jobs.admission import QueueLimits, begin_admission, end_admission
from service.jobs.batches import BatchRecords
from service.jobs.blob_records import BlobRecords
from service.jobs.characteristics import CharacteristicsRecords
from service.jobs.expiry import ExpiryQueries
from service.jobs.forecast import Forecasts
from service.jobs.models import DEFAULT_TENANT, IdempotencyRow, JobRow
from service.jobs.queue_entries import QueueEntries, next_rank
from service.jobs.transitions import JobTransitions
from service.jobs.workers import WorkerRegistry

ID_BATCH = 500  # of one query: databases limit its parameters
log = structlog.get_logger()


def batched(job_ids: Sequence[str]) -> Iterator[Sequence[str]]:
    """In pieces of ID_BATCH."""
    return (job_ids[first : first + ID_BATCH] for first in range(0, len(job_ids), ID_BATCH))


class JobStore(
    JobTransitions,
    QueueEntries,
    WorkerRegistry,
    BlobRecords,
    CharacteristicsRecords,
    BatchRecords,
    ExpiryQueries,
    Forecasts,
):
    """All tables of jobs of one database. Safe to share between threads; rows are detached copies."""

    def add(self, row: JobRow, limits: QueueLimits | None = None) -> None:
        """Store a new job as accepted. From here on it cannot be lost: the dispatcher and the reaper queue
        it. Raises as QueueLimits.check.
        """
        row.status, row.created_ms = Status.ACCEPTED, self._clock_ms()
        with self._session.begin() as session:
            begin_admission(session)
            row.rank = next_rank(session, row.tenant)
            session.add(row)
            end_admission(session, row.tenant, limits)

    def add_once(
        self, row: JobRow, key: str, request_sha256: str, limits: QueueLimits | None = None
    ) -> JobRow | None:
        """Store a new job and the client's idempotency key in one transaction. Raises as QueueLimits.check.

        Returns the existing job if the key belongs to one that is not removed; None if the key belongs to
        another request.
        """
        key_row = IdempotencyRow(
            tenant=row.tenant,
            key=key,
            request_sha256=request_sha256,
            job_id=row.id,
            created_ms=self._clock_ms(),
        )
        row.status, row.created_ms = Status.ACCEPTED, self._clock_ms()
        try:
            with self._session.begin() as session:
                begin_admission(session)
                session.add(key_row)
                session.flush()  # the key first: of two requests at once the second fails here
                row.rank = next_rank(session, row.tenant)
                session.add(row)
                end_admission(session, row.tenant, limits)
        except IntegrityError:
            return self._known(row, key, request_sha256)
        return row

    def knows_key(self, tenant: str, key: str) -> bool:
        """True if the key belongs to a job that is not removed."""
        known = (IdempotencyRow.tenant == tenant, IdempotencyRow.key == key, JobRow.removed_ms.is_(None))
        query = select(JobRow.id).join(IdempotencyRow, IdempotencyRow.job_id == JobRow.id).where(*known)
        with self._session() as session:
            return session.scalar(query.limit(1)) is not None

    def _known(self, row: JobRow, key: str, request_sha256: str) -> JobRow | None:
        with self._session.begin() as session:
            known = session.get_one(IdempotencyRow, (row.tenant, key))
            if known.request_sha256 != request_sha256:
                return None
            job = session.get(JobRow, known.job_id)
            if job is not None and job.removed_ms is None:
                return job
            known.job_id = row.id  # its job was removed: the request starts a new one
            row.rank = next_rank(session, row.tenant)
            session.add(row)
            return row

    def get(self, job_id: str, tenant: str = DEFAULT_TENANT) -> JobRow | None:
        """The tenant's job; None if it is unknown or removed."""
        row = self.find(job_id, tenant)
        return None if row is None or row.removed_ms is not None else row

    def find(self, job_id: str, tenant: str | None = None) -> JobRow | None:
        """The job, also if removed; with `tenant` only a job of that tenant."""
        if "\0" in job_id:  # PostgreSQL refuses to search for it
            return None
        with self._session() as session:
            row = session.get(JobRow, job_id)
        return row if row is None or tenant in (None, row.tenant) else None

    def find_kept(self, job_id: str) -> JobRow | None:
        """The job of any tenant; None if it is unknown or removed."""
        row = self.find(job_id)
        return None if row is None or row.removed_ms is not None else row

    def kept(self, job_ids: Sequence[str]) -> dict[str, JobRow]:
        """The jobs of these ids, of any tenant, without those that are unknown or removed."""
        found: dict[str, JobRow] = {}
        with self._session() as session:
            for some in batched([job_id for job_id in job_ids if "\0" not in job_id]):
                query = select(JobRow).where(JobRow.id.in_(some), JobRow.removed_ms.is_(None))
                found |= {row.id: row for row in session.scalars(query)}
        return found

    def fingerprints(self, job_ids: Sequence[str]) -> dict[str, tuple[object, ...]]:
        """Of each job that is not removed: values that change whenever its status document does."""
        found: dict[str, tuple[object, ...]] = {}
        status = type_coerce(JobRow.status, String)  # a later version may have other words
        columns = (JobRow.id, status, JobRow.stage, JobRow.progress, JobRow.message, JobRow.attempt)
        with self._session() as session:
            for some in batched(job_ids):
                query = select(*columns).where(JobRow.id.in_(some), JobRow.removed_ms.is_(None))
                found |= {row[0]: tuple(row) for row in session.execute(query)}
        return found

    def page(
        self,
        *,
        tenant: str = DEFAULT_TENANT,
        status: Status | None = None,
        job_type: JobType | None = None,
        label: str | None = None,
        name: str | None = None,
        equal: Mapping[str, str | None] | None = None,
        before_id: str | None = None,
        limit: int,
    ) -> tuple[Sequence[JobRow], str | None]:
        """Up to `limit` jobs of the tenant older than `before_id`, newest first, since ids sort by time.

        name : part of a name of the job, see `names_of`; equal : columns that must have a value, None for
        any. Returns them and the `before_id` of the next page, if there is one. A row that cannot be read is
        left out.
        """
        conditions = [JobRow.tenant == tenant, JobRow.removed_ms.is_(None)]
        if status is not None:
            conditions.append(JobRow.status == status)
        if job_type is not None:
            conditions.append(JobRow.type == job_type)
        if label is not None and label.startswith("~"):
            conditions.append(JobRow.label.contains(label[1:], autoescape=True))
        elif label is not None:
            conditions.append(JobRow.label == label)
        if name is not None:
            conditions.append(JobRow.names.contains(name.lower(), autoescape=True))
        for column, value in (equal or {}).items():
            if value is not None:
                conditions.append(getattr(JobRow, column) == value)
        if before_id is not None:
            conditions.append(JobRow.id < before_id)
        query = select(JobRow).where(*conditions).order_by(JobRow.id.desc()).limit(limit + 1)
        with self._session() as session:
            try:
                rows = session.scalars(query).all()
                ids = [row.id for row in rows]
            except DBAPIError:
                raise
            except Exception:
                ids = list(session.scalars(query.with_only_columns(JobRow.id)))
                rows = [row for row in map(self._readable, ids) if row is not None]
        more = len(ids) > limit
        return [row for row in rows if row.id != ids[-1]] if more else rows, ids[limit - 1] if more else None

    def _readable(self, job_id: str) -> JobRow | None:
        try:
            return self.find(job_id)
        except DBAPIError:
            raise
        except Exception:
            log.exception("a job's row cannot be read; repair it in the database", job_id=job_id)
            return None

    def count(self, status: Status, tenant: str | None = None) -> int:
        """Number of jobs with this status; with `tenant` only those of that tenant."""
        query = select(func.count()).where(JobRow.status == status)
        if tenant is not None:
            query = query.where(JobRow.tenant == tenant)
        with self._session() as session:
            return session.scalar(query) or 0
