"""The worker process: opens its parts, runs until it gets a signal, and ends within seconds."""

import os
import signal
import threading
import time
from dataclasses import asdict
from pathlib import Path

import structlog

from service.execution.confinement.measures import Measures
from service.execution.folder_removal import remove_folder
from service.execution.job_limits import Limits
from service.execution.job_tasks import JobTasks
from service.execution.letterhead import Letterhead
from service.execution.periodic import PeriodicTask
from service.execution.sandbox import Sandbox, SandboxError
from service.execution.worker import Worker
from service.jobs.dispatcher import Dispatcher
from service.jobs.liveness import DEAD_AFTER_MS, WORKER_HEARTBEAT_S
from service.jobs.metrics import Metrics
from service.jobs.queue import DbosQueue, DbosRunner
from service.jobs.reaper import Reaper
from service.jobs.retention import Retention
from service.jobs.store import JobStore
from service.settings import MIB, ServiceSettings
from service.storage.blobs import BlobStore
from service.storage.commit_watch import CommitWatch
from service.storage.database import open_database
from service.storage.design_cache import DesignCache
from service.webhooks.address_guard import Guard
from service.webhooks.http_client import Poster
from service.webhooks.mesh_fetch import MeshFetcher
from service.webhooks.outbox import Deliveries
from service.webhooks.sender import Sender

EXIT_BROKEN = 3  # no job can run on this machine: a restart would not help
SWEEP_INTERVAL_S = 5.0
RETENTION_INTERVAL_S = 60.0
POLL_INTERVAL_S = 0.2
STOP_TIMEOUT_S = 5.0
log = structlog.get_logger()


def run_worker(settings: ServiceSettings) -> int:
    """Run jobs until SIGTERM or SIGINT. Returns the exit code for `os._exit`, since threads may hang."""
    stop = threading.Event()
    for kind in (signal.SIGTERM, signal.SIGINT):
        signal.signal(kind, lambda *_: stop.set())
    engine = open_database(settings.database)
    jobs, blobs = JobStore(engine), BlobStore(settings.blobs)
    if not settings.is_embedded and _is_taken(jobs, settings.worker_id):
        log.error("a live worker has this name already; set CUSP_WORKER_ID", worker_id=settings.worker_id)
        return EXIT_BROKEN
    try:
        letterhead = Letterhead.of(settings.report_company, settings.report_logo)
    except ValueError as error:
        log.error("cannot run jobs", reason=str(error))
        return EXIT_BROKEN
    limits = Limits(settings.job_time_limit_s, settings.job_memory_limit_mib, settings.job_disk_limit_mib)
    sandbox = Sandbox(limits)
    try:
        sandbox.start()
        _check_measures(sandbox.measures, is_required=settings.sandbox == "require")
    except SandboxError as error:
        sandbox.stop()
        log.error("cannot run jobs", reason=str(error))
        return EXIT_BROKEN
    scratch = settings.scratch_dir / settings.worker_id
    _clear(scratch)
    designs = DesignCache(blobs.store, settings.design_cache_mib)
    metrics = Metrics(engine, settings.data_dir)
    fetcher = MeshFetcher(
        Guard.of(settings.mesh_networks, "CUSP_MESH_NETWORKS"),
        settings.max_upload_mib * MIB,
        settings.mesh_fetch_time_limit_s,
    )
    tasks = JobTasks(jobs, blobs, designs, fetcher, letterhead)
    worker = Worker(settings.worker_id, jobs, blobs, tasks, sandbox, scratch, metrics)
    queue = DbosQueue(settings.queue)
    reaper = Reaper(jobs, queue, clock_may_jump=settings.is_embedded)
    reaper.at_start(settings.worker_id)
    runner = DbosRunner(settings.queue, settings.worker_id, settings.jobs, worker.run)
    runner.start()
    dispatcher = Dispatcher(jobs, queue, CommitWatch.of(settings.database))
    threading.Thread(target=dispatcher.run, args=(stop,), daemon=True).start()
    log.info("worker ready", jobs=settings.jobs, pid=os.getpid())
    poster = Poster(Guard.of(settings.webhook_networks))
    threading.Thread(target=Sender(Deliveries(engine), poster).run, args=(stop,), daemon=True).start()
    retention = Retention(jobs, blobs, designs, settings.retention_h)
    alive = PeriodicTask(
        "worker heartbeat", lambda: jobs.worker_beat(settings.worker_id), WORKER_HEARTBEAT_S
    ).begin(stop)
    # After an outage of the database, wait for the heartbeats of workers that could not write them.
    PeriodicTask("recover lost jobs", reaper.sweep, SWEEP_INTERVAL_S, DEAD_AFTER_MS / 1000).begin(stop)
    PeriodicTask("retention", retention.sweep, RETENTION_INTERVAL_S).begin(stop)
    while worker.broken is None and not stop.wait(POLL_INTERVAL_S):
        pass
    stop.set()
    in_time = worker.stop(STOP_TIMEOUT_S)
    sandbox.stop()
    runner.stop()  # before requeue: it would take those entries again
    for row in worker.released:
        queue.requeue(row.id, row.rank)  # for any other worker
    alive.join(WORKER_HEARTBEAT_S)  # a late heartbeat would undo the next line
    jobs.worker_gone(settings.worker_id)
    log.info("worker stops", released=in_time)
    if worker.broken is not None:
        log.error("cannot run jobs", reason=str(worker.broken))
        return EXIT_BROKEN
    return 0


def _clear(scratch: Path) -> None:
    """Make the folder of the folders of jobs, without what a worker left that was killed."""
    scratch.mkdir(parents=True, exist_ok=True)
    scratch.chmod(0o700)
    for left in scratch.iterdir():
        try:
            remove_folder(left)
        except OSError as error:
            log.error("the folder of a job is not removed", folder=left.name, reason=str(error))


def _check_measures(measures: Measures, *, is_required: bool) -> None:
    """Log how jobs are confined: one warning where something is missing; an error if all is required."""
    if not measures.missing:
        log.info("jobs are confined", **asdict(measures))
        return
    missing = "; ".join(measures.missing)
    if is_required:
        raise SandboxError(f"CUSP_SANDBOX=require, but this machine does not confine {missing}")
    log.warning("jobs are not fully confined, see docs/security.md", missing=missing)


def _is_taken(jobs: JobStore, worker_id: str) -> bool:
    """True if another process writes heartbeats under this name: the two would take each other's jobs."""
    heard_ms = jobs.worker_heard_ms(worker_id)
    if heard_ms is None or heard_ms < jobs.now_ms() - 60_000:
        return False
    time.sleep(2.5 * WORKER_HEARTBEAT_S)
    return jobs.worker_heard_ms(worker_id) != heard_ms
