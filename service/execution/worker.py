"""Runs each job that the queue brings, from its claim to the publication of its results."""

import errno
import shutil
import threading
import time
import uuid
from collections.abc import Callable
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

import structlog

from pipeline import Characteristics, PipelineError, detect_format
from service.contract.design_options import completed, known_blob
from service.contract.errors import (
    DigestMismatch,
    InternalError,
    JobCrashed,
    ServiceError,
    UnknownBlob,
    problem_of,
)
from service.contract.job_types import ALL_MESHES
from service.contract.options import resolve_settings
from service.contract.schemas import Options, Problem
from service.execution.heartbeat import Heartbeat
from service.execution.letterhead import Letterhead
from service.execution.results_outcome import outcome_of
from service.execution.sandbox import Outcome, Sandbox, SandboxError, log_tail
from service.jobs.metrics import Metrics
from service.jobs.models import JobRow
from service.jobs.store import JobStore
from service.storage import design_cache
from service.storage.blobs import BlobStore, Upload
from service.storage.design_cache import DesignCache
from service.storage.design_faces import DesignFaces
from service.storage.retry import DATABASE_UNAVAILABLE, retry_transient, unavailable_dependency
from service.webhooks.mesh_fetch import MeshFetcher, without_query

FULL_BYTES = 4 * 2**20  # with less free space, a process that died is taken to have died of that
FULL_DISK_RUNS = 3  # of one attempt: then the job is taken for what fills the disk
Returned = TypeVar("Returned")
NO_LETTERHEAD = Letterhead()
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
        designs: DesignCache,
        sandbox: Sandbox,
        scratch: Path,
        metrics: Metrics,
        fetcher: MeshFetcher,
        letterhead: Letterhead = NO_LETTERHEAD,
    ) -> None:
        self._id, self._jobs, self._blobs, self._designs = worker_id, jobs, blobs, designs
        self._sandbox, self._scratch, self._metrics = sandbox, scratch, metrics
        self._fetcher, self._letterhead = fetcher, letterhead
        self._faces = DesignFaces(blobs.store)
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
            with Heartbeat(partial(self._jobs.beat, row.id, row.attempt)) as heart:
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
            self._release(row)
        except Exception as error:
            if (unavailable := unavailable_dependency(error)) is not None:
                log.warning("job released", unavailable=unavailable, reason=str(error)[:300])
                self._release(row)
                return
            instance = f"urn:uuid:{uuid.uuid4()}"
            log.exception("worker failed", instance=instance)
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

    def _retry(self, act: Callable[[], Returned], heart: Heartbeat) -> Returned:
        return retry_transient(act, is_wanted=lambda: heart.is_ours and not self._stopping.is_set())

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
            shutil.rmtree(folder, ignore_errors=True)
            self._retry(self._check_room, heart)
            runs += 1

    def _check_room(self) -> None:
        if shutil.disk_usage(self._scratch).free < FULL_BYTES:
            raise OSError(errno.ENOSPC, "no room for the files of a job")

    def _run_process(self, row: JobRow, folder: Path, heart: Heartbeat) -> Outcome:
        folder.mkdir(parents=True, exist_ok=True)
        try:
            task = self._task(row, folder, heart)
        except (ServiceError, PipelineError) as error:
            if self._stopping.is_set():  # a mesh may have been left half fetched
                return Outcome("unwanted", None, 0.0, None)
            return Outcome("failed", problem_of(error), 0.0, None)
        clock = StageClock()

        def on_progress(stage: str, percent: float, message: str) -> None:
            clock.enter(stage, message)
            heart.note(stage, percent, message)

        def is_wanted() -> bool:
            return heart.is_ours and not self._stopping.is_set()

        outcome = self._sandbox.run(f"{row.id}/{row.attempt}", task, on_progress, is_wanted)
        clock.end()
        self._count(row, task, outcome, clock)
        if outcome.kind == "done":
            self._keep_design(row, task)
        return outcome

    def _task(self, row: JobRow, folder: Path, heart: Heartbeat) -> dict[str, Any]:
        """The task for `child.run`; the meshes are copied into the folder of the job."""
        if any("url" in source and not source.get("blob") for source in row.inputs.values()):
            row = self._fetch_meshes(row, heart)
        options = Options.model_validate(row.options)
        task: dict[str, Any] = {
            "folder": str(folder),
            "out": str(folder / "out"),
            "type": row.type,
            "settings": resolve_settings(options).model_dump(mode="json"),
            "tolerance_mm": options.tolerance_mm,
            "scan_accuracy_mm": options.scan_accuracy_mm,
            "acceptance": options.acceptance and options.acceptance.model_dump(mode="json"),
            "reference": options.reference and options.reference.model_dump(mode="json"),
            "alignment": options.alignment and options.alignment.model_dump(mode="json"),
            "seed": options.seed,
            "report": {
                "job": row.id,
                "created": datetime.fromtimestamp(row.created_ms / 1000, UTC).isoformat(),
                "company": self._letterhead.company,
                "logo": self._letterhead.logo,
            },
        }
        for mesh, source in row.inputs.items():
            path = folder / f"{mesh}.mesh"  # not the client's file name, which is only a hint of the format
            self._fetch(source["blob"], path, heart, mesh)
            unit = getattr(options.units, mesh)
            task[mesh] = {"path": str(path), "filename": source["filename"], "unit": unit}
        if row.type == "registration":
            task["design"]["part"] = options.design_part
            task["scan"]["columns"] = options.columns
            name = design_cache.name_of(
                row.tenant, row.inputs["design"]["blob"], task["design"], task["settings"], options.seed
            )
            task["design_cache"] = str(folder / f"{name}.npz")
            known = self._fetch_design(name, folder / f"{name}.npz")
            log.info(
                "design model cached" if known else "design model not cached yet",
                design=row.inputs["design"]["blob"],
            )
            task["design_known"] = known
        return task

    def _fetch_meshes(self, row: JobRow, heart: Heartbeat) -> JobRow:
        """The row with a blob for each mesh that was given by its address.

        Raises
        ------
        MeshNotFetched, PayloadTooLarge, DigestMismatch, InvalidOptions, PipelineError
        """
        inputs, options = dict(row.inputs), row.options
        for mesh, source in row.inputs.items():
            if "url" not in source or source.get("blob"):
                continue
            if mesh == "design" and row.batch_id is not None:
                known = self._jobs.fetched_design(row.batch_id, without_query(source["url"]))
                if known is not None and source.get("sha256") is None:
                    inputs[mesh] = known
                    options = self._with_design(row, options, known["blob"])
                    continue
            heart.note("load", 0.0, f"load: fetching {mesh}")
            upload = self._fetch_url(mesh, source, heart)
            filename = source.get("filename") or without_query(source["url"]).rpartition("/")[2][-255:]
            try:
                kind = detect_format(upload.head, upload.size, filename, mesh=mesh)
                self._blobs.keep(upload)
            except BaseException:
                self._blobs.discard(upload)
                raise
            self._jobs.add_blob(upload.blob_id, upload.size, kind.value, row.tenant)
            # The query is dropped: it may hold a signature
            url = without_query(source["url"])
            inputs[mesh] = {"blob": upload.blob_id, "filename": filename, "url": url}
            if mesh == "design" and known_blob(source) is None:
                options = self._with_design(row, options, upload.blob_id)
        self._retry(lambda: self._jobs.note_inputs(row.id, row.attempt, inputs, options), heart)
        row.inputs, row.options = inputs, options
        return row

    def _with_design(self, row: JobRow, options: dict[str, Any], design: str) -> dict[str, Any]:
        """The options completed by what is kept with the design."""
        kept = self._jobs.characteristics(design, row.tenant)
        document = None if kept is None else Characteristics.model_validate(kept.document)
        return completed(Options.model_validate(options), document).model_dump(mode="json")

    def _fetch_url(self, mesh: str, source: dict[str, Any], heart: Heartbeat) -> Upload:
        writer = self._blobs.writer()
        try:
            self._fetcher.fetch(source["url"], writer, lambda: heart.is_ours and not self._stopping.is_set())
            upload = writer.finish()
        except ServiceError as error:
            writer.abort()
            error.detail = f"{mesh}: {error.detail}"
            raise
        except BaseException:
            writer.abort()
            raise
        if source.get("sha256") not in (None, upload.sha256):
            self._blobs.discard(upload)
            raise DigestMismatch(
                f"{mesh}: {without_query(source['url'])[:300]} has the digest {upload.sha256}, not "
                f"{source['sha256']}"
            )
        return upload

    def _fetch(self, blob_id: str, path: Path, heart: Heartbeat, mesh: str) -> None:
        try:
            self._retry(lambda: self._blobs.fetch(blob_id, path), heart)
        except FileNotFoundError as error:
            raise UnknownBlob(f"{mesh}: the blob {blob_id} is no longer stored; send it again") from error

    def _fetch_design(self, name: str, path: Path) -> bool:
        """True if the design model was cached. If the cache is unavailable, the design is analysed again."""
        try:
            return self._designs.fetch(name, path)
        except Exception:
            log.exception("cached design model not fetched")
            path.unlink(missing_ok=True)  # it may be incomplete
            return False

    def _count(self, row: JobRow, task: dict[str, Any], outcome: Outcome, clock: "StageClock") -> None:
        """Counters for /metrics; JobStore counts how jobs end. An error here fails no job."""
        try:
            amounts = {"cusp_stage_seconds": clock.seconds, "cusp_stage_passes": clock.passes}
            if "design_known" in task:
                amounts["cusp_designs"] = {"yes" if task["design_known"] else "no": 1}
            self._metrics.add(amounts, {row.type: outcome.peak_mib} if outcome.peak_mib else {})
        except Exception:
            log.exception("counters not written")

    def _keep_design(self, row: JobRow, task: dict[str, Any]) -> None:
        """Store the design model that the job computed, and the names of its faces. A cache that is full or
        unavailable fails no job.
        """
        if "design_cache" not in task or task["design_known"]:
            return
        path = Path(task["design_cache"])
        try:
            self._faces.keep(row.tenant, row.inputs["design"], task["design"]["part"], Path(task["out"]))
            if path.is_file() and not path.is_symlink():
                self._designs.keep(path.stem, path)
        except Exception:
            log.exception("design model not cached")

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
        outcome = outcome_of(out / "results.json")
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
    """True if the job left results in a folder of its own: a link could lead to the results of others."""
    results = out / "results.json"
    return out.is_dir() and not out.is_symlink() and results.is_file() and not results.is_symlink()
