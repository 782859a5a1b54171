"""Every read and write of the jobs table. Each change is one UPDATE that says what it expects to find:
who comes second, or comes back from the dead, changes nothing and is told so."""

import re
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import Any

import structlog
from sqlalchemy import Engine, Text, cast, delete, func, select, update
from sqlalchemy.exc import DBAPIError, IntegrityError
from sqlalchemy.orm import Session, sessionmaker

from service.contract.schemas import JobType, Problem, Status
from service.jobs.deliveries import DeliveryRow, announce
from service.jobs.metrics import count
from service.jobs.models import (
    DEFAULT_TENANT,
    MAX_CRASHES,
    BlobRow,
    IdempotencyRow,
    JobRow,
    WorkerRow,
    check_move,
    now_ms,
)

BLOB_ID = re.compile(r"sha256:[0-9a-f]{64}")
log = structlog.get_logger()


class JobStore:
    """Jobs and blobs of one database. Safe to share between threads; rows it returns are detached copies."""

    def __init__(self, engine: Engine, clock_ms: Callable[[], int] = now_ms) -> None:
        self._session = sessionmaker(engine, expire_on_commit=False)
        self._clock_ms = clock_ms

    # --- the API's side

    def add(self, row: JobRow) -> None:
        """Store a new job as accepted. It is safe from here on: the reaper enqueues what nobody else did."""
        row.status, row.created_ms = Status.ACCEPTED, self._clock_ms()
        with self._session.begin() as session:
            row.turn = _next_turn(session, row.tenant)
            session.add(row)

    def add_once(self, row: JobRow, key: str, request_sha256: str) -> JobRow | None:
        """Store a new job under the client's key, in one transaction. When the key stands for a job that is still there,
        that one is returned instead; None when it stands for another request.
        """
        given = IdempotencyRow(
            tenant=row.tenant,
            key=key,
            request_sha256=request_sha256,
            job_id=row.id,
            created_ms=self._clock_ms(),
        )
        row.status, row.created_ms = Status.ACCEPTED, self._clock_ms()
        try:
            with self._session.begin() as session:
                session.add(given)
                session.flush()  # the key first: of two requests at once the second fails here
                row.turn = _next_turn(session, row.tenant)
                session.add(row)
        except IntegrityError:
            return self._known(row, key, request_sha256)
        return row

    def knows_key(self, tenant: str, key: str) -> bool:
        """True when the client's key stands for a job that is still there."""
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
            known.job_id = row.id  # its job was removed: the same request starts anew
            row.turn = _next_turn(session, row.tenant)
            session.add(row)
            return row

    def get(self, job_id: str, tenant: str = DEFAULT_TENANT) -> JobRow | None:
        """The tenant's job, unless it is unknown or removed."""
        row = self.find(job_id, tenant)
        return None if row is None or row.removed_ms is not None else row

    def find(self, job_id: str, tenant: str | None = None) -> JobRow | None:
        """The job, removed ones included; with `tenant` only when it is theirs."""
        if "\0" in job_id:  # which PostgreSQL refuses to look for
            return None
        with self._session() as session:
            row = session.get(JobRow, job_id)
        return row if row is None or tenant in (None, row.tenant) else None

    def page(
        self,
        *,
        tenant: str = DEFAULT_TENANT,
        status: Status | None = None,
        job_type: JobType | None = None,
        label: str | None = None,
        before_id: str | None = None,
        limit: int,
    ) -> tuple[Sequence[JobRow], str | None]:
        """Up to `limit` of the tenant's jobs older than `before_id`, newest first (ids sort by time); and the `before_id` of
        the next page, if there is one. A row that cannot be read is left out.
        """
        fits = [JobRow.tenant == tenant, JobRow.removed_ms.is_(None)]
        if status is not None:
            fits.append(JobRow.status == status)
        if job_type is not None:
            fits.append(JobRow.type == job_type)
        if label is not None:
            fits.append(JobRow.label == label)
        if before_id is not None:
            fits.append(JobRow.id < before_id)
        query = select(JobRow).where(*fits).order_by(JobRow.id.desc()).limit(limit + 1)
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
            log.exception("a job's row cannot be read; see to it in the database", job_id=job_id)
            return None

    def count(self, status: Status, tenant: str | None = None) -> int:
        """How many jobs have this status; with `tenant` only theirs."""
        query = select(func.count()).where(JobRow.status == status)
        if tenant is not None:
            query = query.where(JobRow.tenant == tenant)
        with self._session() as session:
            return session.scalar(query) or 0

    def dismiss(self, job_id: str, before: Status) -> bool:
        """Cancel a job that is `before`; the worker sees it and kills the child of a running one."""
        return self._move(job_id, before, Status.DISMISSED, finished_ms=self._clock_ms())

    def remove(self, job_id: str) -> bool:
        """Forget a final job but for its id, so that a second DELETE finds what it asked for."""
        emptied: dict[str, Any] = {
            "removed_ms": self._clock_ms(),
            "files": None,
            "error": None,
            "label": None,
            "message": None,
        }
        final = [status for status in Status if status.is_final]
        return self._update(job_id, JobRow.status.in_(final), JobRow.removed_ms.is_(None), **emptied)

    # --- the worker's side; `attempt` fences out a worker whose job was handed on

    def claim(self, job_id: str, worker: str) -> JobRow | None:
        """Take an accepted job to run it; None when it is not there to be taken."""
        now = self._clock_ms()
        took = self._move(
            job_id,
            Status.ACCEPTED,
            Status.RUNNING,
            attempt=JobRow.attempt + 1,
            worker=worker,
            started_ms=now,
            heartbeat_ms=now,
            progress=0.0,
            stage=None,
            message=None,
        )
        return self.find(job_id) if took else None

    def beat(self, job_id: str, attempt: int, **progress: Any) -> bool:
        """Say that the job is alive, and how far; False when it is no longer this attempt's to run."""
        mine = (JobRow.status == Status.RUNNING, JobRow.attempt == attempt)
        return self._update(job_id, *mine, heartbeat_ms=self._clock_ms(), **progress)

    def succeed(self, job_id: str, attempt: int, files: list[dict[str, Any]]) -> bool:
        """Publish: from this one UPDATE on, clients see the files of this attempt."""
        return self._finish(
            job_id, attempt, Status.SUCCESSFUL, files=files, published_attempt=attempt, progress=100.0
        )

    def fail(self, job_id: str, attempt: int, problem: Problem) -> bool:
        """End the job with its reason."""
        return self._finish(job_id, attempt, Status.FAILED, error=problem.model_dump(exclude_none=True))

    def hand_back(self, job_id: str, attempt: int) -> bool:
        """Give up an attempt without blame (the worker is asked to stop); another attempt starts later."""
        mine = JobRow.attempt == attempt
        return self._move(
            job_id, Status.RUNNING, Status.ACCEPTED, mine, counted_as="handed_back", **_UNSTARTED
        )

    def orphans(self, *, worker: str | None = None, silent_since_ms: int | None = None) -> Sequence[str]:
        """Ids of running jobs of `worker`, or whose worker was not heard of since then: ids only, for one row that cannot be
        read must not hide the others."""
        query = select(JobRow.id).where(JobRow.status == Status.RUNNING)
        if worker is not None:
            query = query.where(JobRow.worker == worker)
        if silent_since_ms is not None:
            query = query.where(JobRow.heartbeat_ms < silent_since_ms)
        with self._session() as session:
            return session.scalars(query.order_by(JobRow.id)).all()

    def hand_on(self, row: JobRow, crashed: Problem) -> Status | None:
        """Return a dead worker's job to the queue, or fail it with `crashed` when it took MAX_CRASHES workers along.

        Returns its new status, or None when somebody else was faster.
        """
        if row.crashes + 1 >= MAX_CRASHES:
            return Status.FAILED if self.fail(row.id, row.attempt, crashed) else None
        mine = JobRow.attempt == row.attempt
        values = {**_UNSTARTED, "crashes": row.crashes + 1}
        return (
            Status.ACCEPTED if self._move(row.id, Status.RUNNING, Status.ACCEPTED, mine, **values) else None
        )

    def waiting_since(self, before_ms: int) -> dict[str, int]:
        """Accepted jobs created before then that were given to the queue, oldest first, and the turn of each."""
        waits = (JobRow.status == Status.ACCEPTED, JobRow.has_ticket.is_(True), JobRow.created_ms < before_ms)
        query = select(JobRow.id, JobRow.turn).where(*waits)
        with self._session() as session:
            return {row.id: row.turn for row in session.execute(query.order_by(JobRow.id))}

    def without_ticket(self, limit: int) -> dict[str, int]:
        """Accepted jobs that were never given to the queue, and the turn of each; the first ones first."""
        query = select(JobRow.id, JobRow.turn).where(
            JobRow.has_ticket.is_(False), JobRow.status == Status.ACCEPTED
        )
        with self._session() as session:
            return {
                row.id: row.turn
                for row in session.execute(query.order_by(JobRow.turn, JobRow.id).limit(limit))
            }

    def dismissed_with_ticket(self, limit: int) -> Sequence[str]:
        """Dismissed jobs whose ticket was not taken back."""
        query = select(JobRow.id).where(JobRow.has_ticket.is_(True), JobRow.status == Status.DISMISSED)
        with self._session() as session:
            return session.scalars(query.limit(limit)).all()

    def note_ticket(self, job_ids: Sequence[str], *, has_ticket: bool) -> None:
        """Note that jobs have a ticket, or none."""
        with self._session.begin() as session:
            session.execute(
                update(JobRow).where(JobRow.id.in_(job_ids)).values(has_ticket=has_ticket),
                execution_options={"synchronize_session": False},
            )

    def live_workers(self, within_ms: int) -> set[str]:
        """Names of the workers that were alive so recently."""
        query = select(WorkerRow.id).where(WorkerRow.heartbeat_ms >= self._clock_ms() - within_ms)
        with self._session() as session:
            return set(session.scalars(query))

    def worker_beat(self, worker: str) -> None:
        """Note that the worker is alive."""
        with self._session.begin() as session:
            session.merge(WorkerRow(id=worker, heartbeat_ms=self._clock_ms()))

    def worker_gone(self, worker: str) -> None:
        """Note that the worker stopped."""
        with self._session.begin() as session:
            session.execute(delete(WorkerRow).where(WorkerRow.id == worker))

    def worker_heard_ms(self, worker: str) -> int | None:
        """When the worker was heard of last; None when it never was, or stopped."""
        with self._session() as session:
            return session.scalar(select(WorkerRow.heartbeat_ms).where(WorkerRow.id == worker))

    def has_worker(self, within_ms: int) -> bool:
        """True when some worker was alive so recently."""
        query = select(WorkerRow.id).where(WorkerRow.heartbeat_ms >= self._clock_ms() - within_ms).limit(1)
        with self._session() as session:
            return session.scalar(query) is not None

    # --- blobs

    def add_blob(self, blob_id: str, size: int, mesh_format: str, tenant: str = DEFAULT_TENANT) -> None:
        """Note a stored blob; the same content again is the same blob."""
        row = BlobRow(tenant=tenant, id=blob_id, size=size, format=mesh_format, created_ms=self._clock_ms())
        with suppress(IntegrityError), self._session.begin() as session:  # sent twice at the same moment
            session.merge(row)

    def blob(self, blob_id: str, tenant: str = DEFAULT_TENANT) -> BlobRow | None:
        """The blob, if the tenant sent it."""
        if "\0" in blob_id:
            return None
        with self._session() as session:
            return session.get(BlobRow, (tenant, blob_id))

    def touch_blob(self, blob_id: str, tenant: str) -> bool:
        """Make the tenant's blob new, for a job that names it; False when it is not there (any more)."""
        with self._session.begin() as session:
            done = session.execute(
                update(BlobRow)
                .where(BlobRow.tenant == tenant, BlobRow.id == blob_id)
                .values(created_ms=self._clock_ms())
                .returning(BlobRow.id)
            )
            return done.scalar_one_or_none() is not None

    # --- retention

    def finished_before(self, before_ms: int, limit: int) -> Sequence[str]:
        """Ids of jobs that ended before then and were not removed, oldest first."""
        final = [status for status in Status if status.is_final]
        query = select(JobRow.id).where(
            JobRow.status.in_(final), JobRow.removed_ms.is_(None), JobRow.finished_ms < before_ms
        )
        with self._session() as session:
            return session.scalars(query.order_by(JobRow.id).limit(limit)).all()

    def removed_before(self, before_ms: int, limit: int) -> Sequence[str]:
        """Ids of jobs that were removed before then, oldest first."""
        query = select(JobRow.id).where(JobRow.removed_ms < before_ms)
        with self._session() as session:
            return session.scalars(query.order_by(JobRow.id).limit(limit)).all()

    def forget(self, removed: Sequence[str]) -> None:
        """Delete the rows of removed jobs."""
        with self._session.begin() as session:
            session.execute(delete(IdempotencyRow).where(IdempotencyRow.job_id.in_(removed)))
            session.execute(delete(DeliveryRow).where(DeliveryRow.job_id.in_(removed)))
            session.execute(delete(JobRow).where(JobRow.id.in_(removed), JobRow.removed_ms.is_not(None)))

    def known_jobs(self, job_ids: Sequence[str]) -> set[str]:
        """Those that have a row, removed or not."""
        with self._session() as session:
            return set(session.scalars(select(JobRow.id).where(JobRow.id.in_(job_ids))))

    def blobs_of_unfinished(self) -> set[str]:
        """Ids of the meshes that waiting and running jobs need: as text, so that no row is too odd to be looked at."""
        query = select(cast(JobRow.inputs, Text)).where(JobRow.status.in_([Status.ACCEPTED, Status.RUNNING]))
        with self._session() as session:
            return {blob_id for inputs in session.scalars(query) for blob_id in BLOB_ID.findall(inputs or "")}

    def blobs_before(self, before_ms: int, limit: int) -> Sequence[BlobRow]:
        """Blobs that were sent or named last before then, oldest first."""
        query = select(BlobRow).where(BlobRow.created_ms < before_ms)
        with self._session() as session:
            return session.scalars(query.order_by(BlobRow.created_ms, BlobRow.id).limit(limit)).all()

    def forget_blob(self, blob: BlobRow, before_ms: int) -> bool:
        """Delete the tenant's row, unless the blob was made new meanwhile."""
        with self._session.begin() as session:
            done = session.execute(
                delete(BlobRow)
                .where(BlobRow.tenant == blob.tenant, BlobRow.id == blob.id, BlobRow.created_ms < before_ms)
                .returning(BlobRow.id)
            )
            return done.scalar_one_or_none() is not None

    def known_blobs(self, blob_ids: Sequence[str]) -> set[str]:
        """Those that any tenant has."""
        with self._session() as session:
            return set(session.scalars(select(BlobRow.id).where(BlobRow.id.in_(blob_ids))))

    # --- how changes are made

    def _finish(self, job_id: str, attempt: int, status: Status, **values: Any) -> bool:
        values |= {"finished_ms": self._clock_ms()}
        return self._move(job_id, Status.RUNNING, status, JobRow.attempt == attempt, **values)

    def _move(
        self,
        job_id: str,
        before: Status,
        after: Status,
        *also: Any,
        counted_as: str | None = None,
        **values: Any,
    ) -> bool:
        check_move(before, after)
        return self._update(
            job_id,
            JobRow.status == before,
            *also,
            counted_as=counted_as or _outcome(after, values),
            status=after,
            **values,
        )

    def _update(self, job_id: str, *expected: Any, counted_as: str | None = None, **values: Any) -> bool:
        with self._session.begin() as session:
            done = session.execute(
                update(JobRow).where(JobRow.id == job_id, *expected).values(**values).returning(JobRow.id),
                execution_options={"synchronize_session": False},
            )
            is_done = done.scalar_one_or_none() is not None
            if is_done and counted_as is not None:
                count(session, "cusp_jobs_ended", counted_as)
            if is_done and "status" in values and values["status"].is_final:
                announce(session, job_id, self._clock_ms())
            return is_done


def _outcome(status: Status, values: dict[str, Any]) -> str | None:
    """What /metrics calls the end of a job; None when this is none."""
    if status is Status.FAILED:
        return str(values["error"]["code"])
    return status.value if status.is_final else None


def _next_turn(session: Session, tenant: str) -> int:
    """Start-time fair queueing (Goyal et al. 1996), each job of cost 1: a tenant's next job comes after the tenant's last
    one that waits, but never before what is served now. So tenants with jobs take turns, whoever sent a thousand first.
    """
    waiting = JobRow.status == Status.ACCEPTED
    least = session.scalar(select(func.min(JobRow.turn)).where(waiting))
    if least is not None:
        now = least - 1
    else:
        now = session.scalar(select(func.max(JobRow.turn)).where(JobRow.status == Status.RUNNING)) or 0
    last = session.scalar(select(func.max(JobRow.turn)).where(waiting, JobRow.tenant == tenant)) or 0
    return max(now, last) + 1


_UNSTARTED: dict[str, Any] = {
    "worker": None,
    "heartbeat_ms": None,
    "started_ms": None,
    "stage": None,
    "progress": 0.0,
    "message": None,
}
