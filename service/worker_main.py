"""The worker process: opens everything, runs until it is told to stop, and ends within seconds."""

import os
import shutil
import signal
import threading
import time

import structlog

from service.addresses import Guard
from service.blobs import BlobStore
from service.design_cache import DesignCache
from service.engine import DbosQueue, DbosRunner
from service.job_store import JobStore
from service.jobs import now_ms
from service.metrics import Metrics
from service.post import Poster
from service.reaper import DEAD_AFTER_MS, Reaper
from service.retention import Retention
from service.sandbox import Limits, Sandbox, SandboxError
from service.sender import Sender
from service.settings import ServiceSettings
from service.store import open_database
from service.tickets import TicketDesk
from service.webhooks import Deliveries
from service.worker import Worker

EXIT_BROKEN = 3  # no job can run on this machine: starting again would not help
BEAT_INTERVAL_S = 1.0
SWEEP_INTERVAL_S = 5.0
RETENTION_INTERVAL_S = 60.0
STOP_TIMEOUT_S = 5.0
log = structlog.get_logger()


def run_worker(settings: ServiceSettings) -> int:
    """Run jobs until SIGTERM or SIGINT. Returns the exit code; call `os._exit` with it, for threads may hang."""
    stop = threading.Event()
    for kind in (signal.SIGTERM, signal.SIGINT):
        signal.signal(kind, lambda *_: stop.set())
    engine = open_database(settings.database)
    jobs, blobs = JobStore(engine), BlobStore(settings.blobs)
    if not settings.is_embedded and _is_taken(jobs, settings.worker_id):
        log.error("another worker has this name and lives; set CUSP_WORKER_ID", worker_id=settings.worker_id)
        return EXIT_BROKEN
    sandbox = Sandbox(Limits(settings.job_time_limit_s, settings.job_memory_limit_mib))
    try:
        sandbox.start()
    except SandboxError as error:
        log.error("cannot run jobs", reason=str(error))
        return EXIT_BROKEN
    scratch = settings.scratch_dir / settings.worker_id
    shutil.rmtree(scratch, ignore_errors=True)  # of the jobs that it ran when it was killed
    scratch.mkdir(mode=0o700, parents=True)
    designs = DesignCache(blobs.store, settings.design_cache_mib)
    metrics = Metrics(engine, settings.data_dir)
    worker = Worker(settings.worker_id, jobs, blobs, designs, sandbox, scratch, metrics)
    queue = DbosQueue(settings.queue)
    reaper = Reaper(jobs, queue)
    reaper.at_start(settings.worker_id)
    runner = DbosRunner(settings.queue, settings.worker_id, settings.jobs, worker.run)
    runner.start()
    threading.Thread(target=TicketDesk(jobs, queue).run, args=(stop,), daemon=True).start()
    log.info("worker ready", jobs=settings.jobs, pid=os.getpid())
    poster = Poster(Guard.of(settings.webhook_networks))
    threading.Thread(target=Sender(Deliveries(engine), poster).run, args=(stop,), daemon=True).start()
    retention = Retention(jobs, blobs, settings.retention_h)
    _tend(settings.worker_id, jobs, (reaper, retention), worker, stop)
    in_time = worker.stop(STOP_TIMEOUT_S)
    sandbox.stop()
    runner.stop()  # before the tickets: it would take them again
    for row in worker.handed_back:
        queue.requeue(row.id, row.turn)  # for whichever worker is there
    jobs.worker_gone(settings.worker_id)
    log.info("worker stops", handed_back=in_time)
    if worker.broken is not None:
        log.error("cannot run jobs", reason=str(worker.broken))
        return EXIT_BROKEN
    return 0


def _is_taken(jobs: JobStore, worker_id: str) -> bool:
    """True when somebody else says every second that a worker of this name lives: two would take each other's jobs."""
    heard_ms = jobs.worker_heard_ms(worker_id)
    if heard_ms is None or heard_ms < now_ms() - 60_000:
        return False
    time.sleep(2.5 * BEAT_INTERVAL_S)
    return jobs.worker_heard_ms(worker_id) != heard_ms


def _tend(
    worker_id: str, jobs: JobStore, sweepers: tuple[Reaper, Retention], worker: Worker, stop: threading.Event
) -> None:
    """Until told to stop: say that this worker lives, look for lost jobs, and let go what is old."""
    reaper, retention = sweepers
    swept_at = let_go_at = float("-inf")
    while worker.broken is None:
        try:
            jobs.worker_beat(worker_id)
            if time.monotonic() - swept_at >= SWEEP_INTERVAL_S:
                swept_at = time.monotonic()
                reaper.sweep()
            if time.monotonic() - let_go_at >= RETENTION_INTERVAL_S:
                let_go_at = time.monotonic()
                retention.sweep()
        except Exception:
            log.exception("sweep failed")  # a busy database, or one that is away; the next one does it
            swept_at = time.monotonic() + DEAD_AFTER_MS / 1000  # workers that were not heard may be heard again
        if stop.wait(BEAT_INTERVAL_S):
            return
