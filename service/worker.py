"""Takes tickets from the queue and runs each job from its claim to its publication."""

import shutil
import threading
import time
import uuid
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import structlog
from sqlalchemy.exc import OperationalError

from service import design_cache
from service.blobs import BlobStore
from service.design_cache import DesignCache
from service.errors import InternalError, JobCrashed, problem_of
from service.job_store import JobStore
from service.job_types import ALL_MESHES
from service.jobs import JobRow
from service.metrics import Metrics
from service.options import resolve_settings
from service.sandbox import Outcome, Sandbox, SandboxError, log_tail
from service.schemas import Options

DATABASE_PATIENCE_S = 600.0
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
            outcome = self._compute(row, folder)
            self._patiently(lambda: self._conclude(row, folder, outcome))
        except SandboxError as error:
            self.broken = error
            self._stopping.set()
            self._hand_back(row)
        except Exception:
            instance = f"urn:uuid:{uuid.uuid4()}"
            log.exception("worker failed", instance=instance)
            detail = f"an unforeseen error in the worker; report it with the id {instance}"
            problem = problem_of(InternalError(detail), instance=instance)
            self._patiently(lambda: self._jobs.fail(row.id, row.attempt, problem))
        finally:
            shutil.rmtree(folder, ignore_errors=True)

    def _hand_back(self, row: JobRow) -> bool:
        done = self._jobs.hand_back(row.id, row.attempt)
        if done:
            self.handed_back.append(row)
        return done

    def _patiently(self, act: Callable[[], object]) -> None:
        """Again and again while the database is away: a restart of it must not cost what was computed."""
        deadline = time.monotonic() + DATABASE_PATIENCE_S
        while True:
            try:
                act()
                return
            except OperationalError:
                if self._stopping.is_set() or time.monotonic() > deadline:
                    raise
                log.warning("the database is away; trying again")
                self._stopping.wait(1.0)

    def _compute(self, row: JobRow, folder: Path) -> Outcome:
        folder.mkdir(parents=True, exist_ok=True)
        task = self._task(row, folder)
        beat = self._jobs.beat
        clock = StageClock()

        def on_progress(stage: str, percent: float, message: str) -> None:
            clock.enter(stage, message)
            with suppress(OperationalError):  # told again soon
                beat(
                    row.id,
                    row.attempt,
                    stage=stage,
                    progress=min(max(percent, 0.0), 100.0),
                    message=message[:500],
                )

        def is_wanted() -> bool:
            if self._stopping.is_set():
                return False
            try:
                return beat(row.id, row.attempt)
            except OperationalError:  # go on: whether the job is still ours is asked when the database is back
                return True

        outcome = self._sandbox.run(f"{row.id}/{row.attempt}", task, on_progress, is_wanted)
        clock.end()
        self._count(row, task, outcome, clock)
        if outcome.kind == "done":
            self._keep_design(task)
        return outcome

    def _task(self, row: JobRow, folder: Path) -> dict[str, Any]:
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
            self._blobs.fetch(given["blob"], path)
            unit = getattr(options.units, mesh)
            task[mesh] = {"path": str(path), "filename": given["filename"], "unit": unit}
        if row.type == "registration":
            name = design_cache.name_of(
                row.tenant, row.inputs["design"]["blob"], task["design"], task["settings"], options.seed
            )
            task["design_cache"] = str(folder / f"{name}.npz")
            known = self._designs.fetch(name, folder / f"{name}.npz")
            log.info("design known" if known else "design new", design=row.inputs["design"]["blob"])
            task["design_known"] = known
        return task

    def _count(self, row: JobRow, task: dict[str, Any], outcome: Outcome, clock: "StageClock") -> None:
        """For /metrics. A count that cannot be made fails no job."""
        handed_back = outcome.kind == "unwanted" and self._stopping.is_set()
        ended = {"done": "successful", "unwanted": "handed_back" if handed_back else "dismissed"}.get(outcome.kind)
        code = ended or (outcome.problem.code if outcome.problem else "job_crashed")
        try:
            self._metrics.add("cusp_jobs_ended", {code: 1})
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

    def _conclude(self, row: JobRow, folder: Path, outcome: Outcome) -> None:
        facts = {
            "seconds": round(outcome.seconds, 2),
            "peak_mib": outcome.peak_mib and round(outcome.peak_mib),
        }
        if outcome.kind == "unwanted":
            handed_back = self._stopping.is_set() and self._hand_back(row)
            log.info("job handed back" if handed_back else "job dismissed", **facts)
        elif outcome.kind == "failed" and outcome.problem is not None:
            self._jobs.fail(row.id, row.attempt, outcome.problem)
            log.warning("job failed", code=outcome.problem.code, detail=outcome.problem.detail, **facts)
            if outcome.problem.status >= 500:
                log.warning("its process said", said=log_tail(folder))
        elif not (folder / "out" / "results.json").is_file():
            self._jobs.fail(row.id, row.attempt, problem_of(JobCrashed("the job ended without results; report it")))
            log.error("job without results", **facts)
        elif self._jobs.succeed(row.id, row.attempt, self._blobs.publish(row.id, row.attempt, folder / "out")):
            log.info("job successful", **facts)
        else:
            self._blobs.remove_results(row.id)  # dismissed while it was published
            log.info("job dismissed", **facts)
