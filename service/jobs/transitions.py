"""Changes of a job's status. Each is one UPDATE that names the state it expects.

A caller that comes second, or whose job was reassigned meanwhile, changes nothing and gets False.
"""

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any

from sqlalchemy import select, update

from service.contract.schemas import Problem, Status
from service.jobs.batches import jobs_ended
from service.jobs.deliveries import announce
from service.jobs.metrics import count
from service.jobs.models import MAX_CRASHES, JobRow, check_move
from service.jobs.table_access import TableAccess

_UNSTARTED: dict[str, Any] = {
    "worker": None,
    "heartbeat_ms": None,
    "started_ms": None,
    "stage": None,
    "progress": 0.0,
    "message": None,
}


class JobTransitions(TableAccess):
    """From accepted to a final status; `attempt` excludes a worker whose job was reassigned."""

    def dismiss(self, job_id: str, before: Status) -> bool:
        """Dismiss a job whose status is `before`; the worker of a running job kills its process."""
        return self._move(job_id, before, Status.DISMISSED, finished_ms=self._clock_ms())

    def remove(self, job_id: str) -> bool:
        """Hide a final job from clients. Its id is kept, so that a second DELETE finds it."""
        cleared: dict[str, Any] = {
            "removed_ms": self._clock_ms(),
            "files": None,
            "result_bytes": 0,
            "error": None,
            "label": None,
            "message": None,
            "serial": None,
            "batch": None,
            "part_number": None,
            "names": None,
        }
        final = [status for status in Status if status.is_final]
        return self._update(job_id, JobRow.status.in_(final), JobRow.removed_ms.is_(None), **cleared)

    def claim(self, job_id: str, worker: str) -> JobRow | None:
        """Start an attempt of an accepted job; None if it is not accepted (any more)."""
        now = self._clock_ms()
        was_claimed = self._move(
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
        if not was_claimed:
            return None
        with self._session() as session:
            return session.get(JobRow, job_id)

    def beat(self, job_id: str, attempt: int, **progress: Any) -> bool:
        """Write a heartbeat and the progress; False if the job does not belong to this attempt (any more)."""
        mine = (JobRow.status == Status.RUNNING, JobRow.attempt == attempt)
        return self._update(job_id, *mine, heartbeat_ms=self._clock_ms(), **progress)

    def note_inputs(self, job_id: str, attempt: int, inputs: dict[str, Any], options: dict[str, Any]) -> bool:
        """Store what a running job was found to work on: the blobs of meshes that were fetched."""
        mine = (JobRow.status == Status.RUNNING, JobRow.attempt == attempt)
        return self._update(job_id, *mine, inputs=inputs, options=options)

    def succeed(
        self,
        job_id: str,
        attempt: int,
        files: list[dict[str, Any]],
        progress: Mapping[str, Any] = MappingProxyType({}),
        *,
        verdict: str | None = None,
        decision: str | None = None,
        within: float | None = None,
    ) -> bool:
        """Publish: clients see the files of this attempt from this UPDATE on.

        progress : the last of the job (`stage`, `progress`, `message`), which may not be written yet;
        verdict, decision, within : of the results of a registration
        """
        values = {**progress, "progress": 100.0, "verdict": verdict, "decision": decision}
        values["within"] = within
        values["result_bytes"] = sum(int(file["size"]) for file in files)
        return self._finish(
            job_id, attempt, Status.SUCCESSFUL, files=files, published_attempt=attempt, **values
        )

    def fail(
        self,
        job_id: str,
        attempt: int,
        problem: Problem,
        progress: Mapping[str, Any] = MappingProxyType({}),
    ) -> bool:
        """End the job with the problem that stopped it; progress : as for `succeed`."""
        error = problem.model_dump(exclude_none=True)
        return self._finish(job_id, attempt, Status.FAILED, error=error, **progress)

    def release(self, job_id: str, attempt: int) -> bool:
        """End an attempt that is not to blame (its worker stops); the job waits for another attempt."""
        mine = JobRow.attempt == attempt
        return self._move(
            job_id, Status.RUNNING, Status.ACCEPTED, mine, counted_as="handed_back", **_UNSTARTED
        )

    def orphans(self, *, worker: str | None = None, silent_since_ms: int | None = None) -> Sequence[str]:
        """Ids of running jobs of `worker`, or without a heartbeat since `silent_since_ms`.

        Ids only: one row that cannot be read must not hide the others.
        """
        query = select(JobRow.id).where(JobRow.status == Status.RUNNING)
        if worker is not None:
            query = query.where(JobRow.worker == worker)
        if silent_since_ms is not None:
            query = query.where(JobRow.heartbeat_ms < silent_since_ms)
        with self._session() as session:
            return session.scalars(query.order_by(JobRow.id)).all()

    def reassign(self, row: JobRow, crashed: Problem) -> Status | None:
        """Return the job of a dead worker to the queue, or fail it with `crashed` after MAX_CRASHES dead
        workers.

        Returns its new status, or None if another process was faster.
        """
        if row.crashes + 1 >= MAX_CRASHES:
            return Status.FAILED if self.fail(row.id, row.attempt, crashed) else None
        mine = JobRow.attempt == row.attempt
        values = {**_UNSTARTED, "crashes": row.crashes + 1}
        return (
            Status.ACCEPTED if self._move(row.id, Status.RUNNING, Status.ACCEPTED, mine, **values) else None
        )

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
                update(JobRow)
                .where(JobRow.id == job_id, *expected)
                .values(**values)
                .returning(JobRow.id, JobRow.batch_id),
                execution_options={"synchronize_session": False},
            ).one_or_none()
            is_done = done is not None
            if is_done and counted_as is not None:
                count(session, "cusp_jobs_ended", counted_as)
            if is_done and values.get("decision") is not None:
                count(session, "cusp_decisions", values["decision"])
            if is_done and "status" in values and values["status"].is_final:
                announce(session, job_id, self._clock_ms())
                if done is not None and done.batch_id is not None:
                    jobs_ended(session, done.batch_id, self._clock_ms())
            return is_done


def _outcome(status: Status, values: dict[str, Any]) -> str | None:
    """The outcome that /metrics counts; None if the status is not final."""
    if status is Status.FAILED:
        return str(values["error"]["code"])
    return status.value if status.is_final else None
