"""Takes tickets from the queue and runs each job from its claim to its publication."""

import shutil
import threading
import time
import uuid
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any, TypeVar

import structlog

from service.contract.errors import InternalError, JobCrashed, UnknownBlob, problem_of
from service.contract.job_types import ALL_MESHES
from service.contract.options import resolve_settings
from service.contract.schemas import Options, Problem
from service.execution.heartbeat import Heartbeat
from service.execution.sandbox import Outcome, Sandbox, SandboxError, log_tail
from service.jobs.metrics import Metrics
from service.jobs.models import JobRow
from service.jobs.store import JobStore
from service.storage import design_cache
from service.storage.blobs import BlobStore
from service.storage.design_cache import DesignCache
from service.storage.retry import DATABASE_UNAVAILABLE, retry_transient, unavailable_dependency

Made = TypeVar("Made")
log = structlog.get_logger()


class StageClock:
    """Seconds and passages by stage, from the progress that a job tells."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}
        self.passes: dict[str, float] = {}
        self._now: tuple[str, str] | None = None
        self._since = 0.0

    def enter(self, stage: str, message: str) -> None:
        """A stage goes on, or another begins; of one stage each mesh is a passage."""
        mesh = message.removeprefix(f"{stage}: ") if message.removeprefix(f"{stage}: ") in ALL_MESHES else ""
        if self._now != (stage, mesh):
            self.end()
            self._now, self._since = (stage, mesh), time.monotonic()
            self.passes[stage] = self.passes.get(stage, 0.0) + 1

    def end(self) -> None:
        """The stage that runs ends now."""
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
        designs: DesignCache,
        sandbox: Sandbox,
        scratch: Path,
        metrics: Metrics,
    ) -> None:
        self._id, self._jobs, self._blobs, self._designs = worker_id, jobs, blobs, designs
        self._sandbox, self._scratch, self._metrics = sandbox, scratch, metrics
        self._stopping = threading.Event()
        self._busy = 0
        self._idle = threading.Condition()
        self.handed_back: list[JobRow] = []
        self.broken: SandboxError | None = None  # set once no job can run any more: end this process

    def run(self, job_id: str) -> None:
        """Run a job that may be there to be run. Whatever happens, its row tells how it ended."""
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
            # Returning would use the ticket up, though its job waits again. The process is about to end, and
            # unfinished tickets come back at the next start.
            threading.Event().wait()

    def stop(self, timeout_s: float) -> bool:
        """Kill what runs and hand it back to the queue; True when that was done in time."""
        self._stopping.set()
        with self._idle:
            return self._idle.wait_for(lambda: self._busy == 0, timeout_s)

    def _run_claimed(self, row: JobRow) -> None:
        folder = self._scratch / f"{row.id}-{row.attempt}"
        waited_s = (time.time() * 1000 - row.created_ms) / 1000
        log.info("job starts", type=row.type, waited_s=round(waited_s, 2))
        try:
            with Heartbeat(lambda: self._jobs.beat(row.id, row.attempt)) as heart:
                self._run_beating(row, folder, heart)
        finally:
            shutil.rmtree(folder, ignore_errors=True)

    def _run_beating(self, row: JobRow, folder: Path, heart: Heartbeat) -> None:
        try:
            outcome = self._compute(row, folder, heart)
            self._conclude(row, folder, outcome, heart)
        except SandboxError as error:
            self.broken = error
            self._stopping.set()
            self._hand_back(row)
        except Exception as error:
            if (away := unavailable_dependency(error)) is not None:
                log.warning("job handed back", away=away, reason=str(error)[:300])
                self._hand_back(row)
                return
            instance = f"urn:uuid:{uuid.uuid4()}"
            log.exception("worker failed", instance=instance)
            detail = f"an unforeseen error in the worker; report it with the id {instance}"
            self._fail(row, problem_of(InternalError(detail), instance=instance), heart)

    def _hand_back(self, row: JobRow) -> bool:
        """Without blame; False when it was not ours any more. The reaper finds it waiting without a ticket; when this worker
        stops, `handed_back` gets theirs at once.
        """
        try:
            done = self._jobs.hand_back(row.id, row.attempt)
        except DATABASE_UNAVAILABLE:
            return False  # silent from now on: the reaper hands it on
        if done and self._stopping.is_set():
            self.handed_back.append(row)
        return done

    def _retry(self, act: Callable[[], Made], heart: Heartbeat) -> Made:
        return retry_transient(act, is_wanted=lambda: heart.is_ours and not self._stopping.is_set())

    def _fail(self, row: JobRow, problem: Problem, heart: Heartbeat) -> None:
        self._retry(lambda: self._jobs.fail(row.id, row.attempt, problem), heart)

    def _compute(self, row: JobRow, folder: Path, heart: Heartbeat) -> Outcome:
        folder.mkdir(parents=True, exist_ok=True)
        try:
            task = self._task(row, folder, heart)
        except UnknownBlob as error:
            return Outcome("failed", problem_of(error), 0.0, None)
        clock = StageClock()

        def on_progress(stage: str, percent: float, message: str) -> None:
            clock.enter(stage, message)
            with suppress(*DATABASE_UNAVAILABLE):  # told again soon
                self._jobs.beat(
                    row.id,
                    row.attempt,
                    stage=stage,
                    progress=min(max(percent, 0.0), 100.0),
                    message=message[:500],
                )

        def is_wanted() -> bool:
            return heart.is_ours and not self._stopping.is_set()

        outcome = self._sandbox.run(f"{row.id}/{row.attempt}", task, on_progress, is_wanted)
        clock.end()
        self._count(row, task, outcome, clock)
        if outcome.kind == "done":
            self._keep_design(task)
        return outcome

    def _task(self, row: JobRow, folder: Path, heart: Heartbeat) -> dict[str, Any]:
        """What `child.run` is told; the meshes are copied into the job's folder."""
        options = Options.model_validate(row.options)
        task: dict[str, Any] = {
            "folder": str(folder),
            "out": str(folder / "out"),
            "type": row.type,
            "settings": resolve_settings(options).model_dump(mode="json"),
            "tolerance_mm": options.tolerance_mm,
            "seed": options.seed,
        }
        for mesh, given in row.inputs.items():
            path = folder / f"{mesh}.mesh"  # never the client's file name: that is a hint, not a path
            self._fetch(given["blob"], path, heart, mesh)
            unit = getattr(options.units, mesh)
            task[mesh] = {"path": str(path), "filename": given["filename"], "unit": unit}
        if row.type == "registration":
            name = design_cache.name_of(
                row.tenant, row.inputs["design"]["blob"], task["design"], task["settings"], options.seed
            )
            task["design_cache"] = str(folder / f"{name}.npz")
            known = self._fetch_design(name, folder / f"{name}.npz")
            log.info("design known" if known else "design new", design=row.inputs["design"]["blob"])
            task["design_known"] = known
        return task

    def _fetch(self, blob_id: str, path: Path, heart: Heartbeat, mesh: str) -> None:
        try:
            self._retry(lambda: self._blobs.fetch(blob_id, path), heart)
        except FileNotFoundError as error:
            raise UnknownBlob(f"{mesh}: the blob {blob_id} is stored here no more; send it again") from error

    def _fetch_design(self, name: str, path: Path) -> bool:
        """A cache that is away costs the analysis anew, and no job."""
        try:
            return self._designs.fetch(name, path)
        except Exception:
            log.exception("design not fetched")
            path.unlink(missing_ok=True)  # half of it, perhaps
            return False

    def _count(self, row: JobRow, task: dict[str, Any], outcome: Outcome, clock: "StageClock") -> None:
        """For /metrics; how jobs ended is counted by JobStore. A count that cannot be made fails no job."""
        try:
            self._metrics.add("cusp_stage_seconds", clock.seconds)
            self._metrics.add("cusp_stage_passes", clock.passes)
            if "design_known" in task:
                self._metrics.add("cusp_designs", {"yes" if task["design_known"] else "no": 1})
            if outcome.peak_mib:
                self._metrics.peak_mib(row.type, outcome.peak_mib)
        except Exception:
            log.exception("not counted")

    def _keep_design(self, task: dict[str, Any]) -> None:
        """Keep the analysis that a job made of its design. A cache that is full or gone fails no job."""
        if "design_cache" not in task or task["design_known"]:
            return
        path = Path(task["design_cache"])
        try:
            if path.is_file() and not path.is_symlink():
                self._designs.keep(path.stem, path)
        except Exception:
            log.exception("design not kept")

    def _conclude(self, row: JobRow, folder: Path, outcome: Outcome, heart: Heartbeat) -> None:
        facts = {
            "seconds": round(outcome.seconds, 2),
            "peak_mib": outcome.peak_mib and round(outcome.peak_mib),
        }
        if outcome.kind == "unwanted" or not heart.is_ours:
            handed_back = self._stopping.is_set() and self._hand_back(row)
            log.info("job handed back" if handed_back else "job no longer wanted", **facts)
        elif outcome.kind == "failed" and outcome.problem is not None:
            self._fail(row, outcome.problem, heart)
            log.warning("job failed", code=outcome.problem.code, detail=outcome.problem.detail, **facts)
            if outcome.problem.status >= 500:
                log.warning("its process said", said=log_tail(folder))
        elif not (folder / "out" / "results.json").is_file():
            self._fail(row, problem_of(JobCrashed("the job ended without results; report it")), heart)
            log.error("job without results", **facts)
        elif self._publish(row, folder / "out", heart):
            log.info("job successful", **facts)
        else:
            log.info("job no longer wanted", **facts)

    def _publish(self, row: JobRow, out: Path, heart: Heartbeat) -> bool:
        """Store the files, then have the row point to them; False when the job was not ours any more, and nothing of this
        attempt is left. Another attempt's files are never touched: they may be the published ones.
        """
        files = self._retry(lambda: self._blobs.publish(row.id, row.attempt, out), heart)
        if self._retry(lambda: self._jobs.succeed(row.id, row.attempt, files), heart):
            return True
        # Not moved by this call. By an earlier one perhaps, whose answer was lost with the connection: ask the row.
        now = self._retry(lambda: self._jobs.find(row.id), heart)
        if now is not None and now.published_attempt == row.attempt and now.removed_ms is None:
            return True
        self._blobs.remove_results(row.id, row.attempt)
        return False
