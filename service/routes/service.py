"""The service itself: probes, version, limits, and what is at the root."""

from fastapi import APIRouter
from fastapi.responses import RedirectResponse

from pipeline import Format
from service import version
from service.api import UseApi
from service.errors import NotReady
from service.identity import Reads
from service.job_types import JOB_TYPES
from service.problems import problems
from service.schemas import Health, Limits, Version

router = APIRouter(tags=["service"])

WORKER_SILENT_MS = 15_000


@router.get("/livez")
def livez() -> Health:
    """Say that the process answers."""
    return Health()


@router.get("/readyz", responses=problems(503))
def readyz(api: UseApi) -> Health:
    """Say that jobs are taken and run: the database answers and a worker lives."""
    if not api.jobs.has_worker(WORKER_SILENT_MS):
        raise NotReady("no worker is alive; jobs are accepted and wait for one")
    return Health()


@router.get("/version")
def get_version() -> Version:
    """Say what is running."""
    return Version(version=version.VERSION)


@router.get("/v1/limits", responses=problems(401, 403))
def limits(api: UseApi, _: Reads) -> Limits:
    """Say what this server accepts."""
    return Limits(
        max_upload_mib=api.settings.max_upload_mib,
        job_time_limit_s=api.settings.job_time_limit_s,
        job_memory_limit_mib=api.settings.job_memory_limit_mib,
        queue_limit=api.settings.queue_limit,
        parallel_jobs=api.settings.jobs,
        job_types=list(JOB_TYPES),
        formats=[each.value for each in Format],
    )


@router.get("/", include_in_schema=False)
def root() -> RedirectResponse:
    """Send a person to the documentation."""
    return RedirectResponse("/docs")
