"""Runs each job that the queue brings, from its claim to the publication of its results."""

import errno
import shutil
import threading
import time
import uuid
from collections.abc import Callable
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

import structlog

from pipeline import PipelineError
from service.contract.errors import (
    InternalError,
    JobCrashed,
    ServiceError,
    problem_of,
)
from service.contract.job_types import ALL_MESHES
from service.contract.schemas import Problem
from service.execution.folder_removal import remove_folder
from service.execution.heartbeat import Heartbeat
from service.execution.job_tasks import JobTasks
from service.execution.results_outcome import MAX_RESULTS_BYTES, RESULTS_FILE, outcome_of
from service.execution.sandbox import Outcome, Sandbox, SandboxError, log_tail
from service.jobs.metrics import Metrics
from service.jobs.models import JobRow
from service.jobs.store import JobStore
from service.storage.blobs import BlobStore
from service.storage.retry import DATABASE_UNAVAILABLE, retry_transient, unavailable_dependency

FULL_BYTES = 4 * 2**20  # with less free space, a process that died is taken to have died of that
FULL_DISK_RUNS = 3  # of one attempt: then the job is taken for what fills the disk
Returned = TypeVar("Returned")
log = structlog.get_logger()


class StageClock:
    """Seconds and passes by stage, from the progress messages of a job."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}
        self.passes: dict[str, float] = {}
        self._now: tuple[str, str] | None = None
        self._since = 0.0

    def enter(self, stage: str, message: str) -> None:
        """Note a progress message: the stage continues, or a new pass begins. Each mesh of a stage is one
        pass.
        """
        mesh = message.removeprefix(f"{stage}: ") if message.removeprefix(f"{stage}: ") in ALL_MESHES else ""
        if self._now != (stage, mesh):
            self.end()
            self._now, self._since = (stage, mesh), time.monotonic()
            self.passes[stage] = self.passes.get(stage, 0.0) + 1

    def end(self) -> None:
        """End the current stage."""
        if self._now is not None:
            stage = self._now[0]
            self.seconds[stage] = self.seconds.get(stage, 0.0) + time.monotonic() - self._since
            self._now = None


class Worker:
    """One worker process's jobs; `run` is called by many threads."""

    def __init__(
        self,
        worker_id: str,
        jobs: JobStore,
        blobs: BlobStore,
        tasks: JobTasks,
        sandbox: Sandbox,
        scratch: Path,
        metrics: Metrics,
    ) -> None:
        self._id, self._jobs, self._blobs, self._tasks = worker_id, jobs, blobs, tasks
        self._sandbox, self._scratch, self._metrics = sandbox, scratch, metrics
        self._stopping = threading.Event()
        self._busy = 0
        self._idle = threading.Condition()
        self.released: list[JobRow] = []
        self.broken: SandboxError | None = None  # set once no job can run: end this process

    def run(self, job_id: str) -> None:
        """Run the job if it can be claimed. Its row tells how it ended, whatever happens."""
        with self._idle:
            self._busy += 1
        try:
            if not self._stopping.is_set() and (row := self._jobs.claim(job_id, self._id)) is not None:
                with structlog.contextvars.bound_contextvars(job_id=job_id, attempt=row.attempt):
                    self._run_claimed(row)
        finally:
            with self._idle:
                self._busy -= 1
                self._idle.notify_all()
        if self._stopping.is_set():
            # To return would consume the queue entry although its job waits again. The process is about to
            # end;
            # entries that are not finished are recovered at the next start.
            threading.Event().wait()

    def stop(self, timeout_s: float) -> bool:
        """Kill running jobs and release them to the queue; True if that was done in time."""
        self._stopping.set()
        with self._idle:
            return self._idle.wait_for(lambda: self._busy == 0, timeout_s)

    def _run_claimed(self, row: JobRow) -> None:
        folder = self._scratch / f"{row.id}-{row.attempt}"
        waited_s = (time.time() * 1000 - row.created_ms) / 1000
        log.info("job starts", type=row.type, waited_s=round(waited_s, 2))
        try:
            self._run_beating(row, folder, Heartbeat(partial(self._jobs.beat, row.id, row.attempt)))
        finally:
            self._remove(folder)

    @staticmethod
    def _remove(folder: Path) -> None:
        """Of a job that ended. A folder that stays costs room, but no job."""
        try:
            remove_folder(folder)
        except OSError as error:
            log.error("the folder of a job is not removed", folder=folder.name, reason=str(error))

    def _run_beating(self, row: JobRow, folder: Path, heart: Heartbeat) -> None:
        with ExitStack() as until_the_end_is_told:
            try:
                until_the_end_is_told.enter_context(heart)
                outcome = self._compute(row, folder, heart)
                self._conclude(row, folder, outcome, heart)
            except SandboxError as error:
                self.broken = error
                self._stopping.set()
                self._release(row)
            except Exception as error:
                self._end_by(error, row, heart)

    def _end_by(self, error: Exception, row: JobRow, heart: Heartbeat) -> None:
        """End a job whose worker met an error: in the queue if it may work later."""
        if (unavailable := unavailable_dependency(error)) is not None:
            log.warning("job released", unavailable=unavailable, reason=str(error)[:300])
            self._release(row)
            return
        instance = f"urn:uuid:{uuid.uuid4()}"
        log.error("worker failed", instance=instance, exc_info=error)
        detail = f"an unexpected error in the worker; report it with the id {instance}"
        self._fail(row, problem_of(InternalError(detail), instance=instance), heart)

    def _release(self, row: JobRow) -> bool:
        """Return the job to the queue, not counted as a crash; False if it belongs to another attempt.

        The reaper requeues it. When this worker stops, it requeues the jobs in `released` itself.
        """
        try:
            done = self._jobs.release(row.id, row.attempt)
        except DATABASE_UNAVAILABLE:
            return False  # without heartbeats from now on: the reaper reassigns it
        if done and self._stopping.is_set():
            self.released.append(row)
        return done

    def _is_wanted(self, heart: Heartbeat) -> bool:
        return heart.is_ours and not self._stopping.is_set()

    def _retry(self, act: Callable[[], Returned], heart: Heartbeat) -> Returned:
        return retry_transient(act, is_wanted=lambda: self._is_wanted(heart))

    def _fail(self, row: JobRow, problem: Problem, heart: Heartbeat) -> None:
        self._retry(lambda: self._jobs.fail(row.id, row.attempt, problem, heart.newest), heart)

    def _compute(self, row: JobRow, folder: Path, heart: Heartbeat) -> Outcome:
        """Run the job; again, when there is room, if its process died because the disk was full."""
        runs = 1
        while True:
            outcome = self._run_process(row, folder, heart)
            is_own_fault = outcome.problem is None or outcome.problem.status < 500
            if is_own_fault or runs == FULL_DISK_RUNS or shutil.disk_usage(folder).free >= FULL_BYTES:
                return outcome
            log.warning("no room is left on the disk: the job waits for room and runs again", runs=runs)
            self._remove(folder)
            self._retry(self._check_room, heart)
            runs += 1

    def _check_room(self) -> None:
        if shutil.disk_usage(self._scratch).free < FULL_BYTES:
            raise OSError(errno.ENOSPC, "no room for the files of a job")

    def _run_process(self, row: JobRow, folder: Path, heart: Heartbeat) -> Outcome:
        folder.mkdir(parents=True, exist_ok=True)

        def is_wanted() -> bool:
            return self._is_wanted(heart)

        try:
            task = self._tasks.task(row, folder, heart, is_wanted)
        except (ServiceError, PipelineError) as error:
            if self._stopping.is_set():  # a mesh may have been left half fetched
                return Outcome("unwanted", None, 0.0, None)
            return Outcome("failed", problem_of(error), 0.0, None)
        clock = StageClock()

        def on_progress(stage: str, percent: float, message: str) -> None:
            clock.enter(stage, message)
            heart.note(stage, percent, message)

        outcome = self._sandbox.run(f"{row.id}/{row.attempt}", task, on_progress, is_wanted)
        clock.end()
        self._count(row, task, outcome, clock)
        if outcome.kind == "done" and _has_results(folder / "out"):  # so it is no link
            self._tasks.keep_design(row, task)
        return outcome

    def _count(self, row: JobRow, task: dict[str, Any], outcome: Outcome, clock: "StageClock") -> None:
        """Counters for /metrics; JobStore counts how jobs end. An error here fails no job."""
        try:
            amounts = {"cusp_stage_seconds": clock.seconds, "cusp_stage_passes": clock.passes}
            if "design_known" in task:
                amounts["cusp_designs"] = {"yes" if task["design_known"] else "no": 1}
            self._metrics.add(amounts, {row.type: outcome.peak_mib} if outcome.peak_mib else {})
        except Exception:
            log.exception("counters not written")

    def _conclude(self, row: JobRow, folder: Path, outcome: Outcome, heart: Heartbeat) -> None:
        facts = {
            "seconds": round(outcome.seconds, 2),
            "peak_mib": outcome.peak_mib and round(outcome.peak_mib),
        }
        if outcome.kind == "unwanted" or not heart.is_ours:
            was_released = self._stopping.is_set() and self._release(row)
            log.info("job released" if was_released else "job no longer wanted", **facts)
        elif outcome.kind == "failed" and outcome.problem is not None:
            self._fail(row, outcome.problem, heart)
            log.warning("job failed", code=outcome.problem.code, detail=outcome.problem.detail, **facts)
            if outcome.problem.status >= 500:
                log.warning("output of the job's process", output=log_tail(folder))
        elif not _has_results(folder / "out"):
            self._fail(row, problem_of(JobCrashed("the job ended without results; report it")), heart)
            log.error("job without results", **facts)
        elif self._publish(row, folder / "out", heart):
            log.info("job successful", **facts)
        else:
            log.info("job no longer wanted", **facts)

    def _publish(self, row: JobRow, out: Path, heart: Heartbeat) -> bool:
        """Store the files, then make the row refer to them.

        False if the job belongs to another attempt; the files of this attempt are deleted then. Files of
        other attempts are not touched: they may be the published ones.
        """
        outcome = outcome_of(out / RESULTS_FILE)
        files = self._retry(lambda: self._blobs.publish(row.id, row.attempt, out), heart)
        if self._retry(
            lambda: self._jobs.succeed(row.id, row.attempt, files, heart.newest, **outcome), heart
        ):
            return True
        # An earlier call may have succeeded although its answer was lost with the connection: read the row.
        now = self._retry(lambda: self._jobs.find(row.id), heart)
        if now is not None and now.published_attempt == row.attempt and now.removed_ms is None:
            return True
        self._blobs.remove_results(row.id, row.attempt)
        return False


def _has_results(out: Path) -> bool:
    """True if the job left results in a folder of its own, of a size that this process can read. A link could
    lead to the results of others.
    """
    results = out / RESULTS_FILE
    if not out.is_dir() or out.is_symlink() or not results.is_file() or results.is_symlink():
        return False
    return results.stat().st_size <= MAX_RESULTS_BYTES
