"""The service itself: probes, metrics, version, limits."""

import shutil

from fastapi import APIRouter, Response
from prometheus_client.exposition import CONTENT_TYPE_PLAIN_0_0_4

from pipeline import Format
from service import version
from service.api.dependencies import UseApi
from service.api.identity import Admins, Reads
from service.api.problems import problems
from service.contract.errors import NotReady
from service.contract.job_types import JOB_TYPES
from service.contract.schemas import Health, Limits, SandboxMeasures, Version
from service.execution.confinement.measures import available
from service.jobs.liveness import DEAD_AFTER_MS
from service.settings import MIB

router = APIRouter(tags=["service"])


@router.get("/livez")
def livez() -> Health:
    """Liveness: the process answers."""
    return Health()


@router.get("/readyz", responses=problems(503))
def readyz(api: UseApi) -> Health:
    """Readiness: the database answers, a worker is alive, and the disk has room."""
    if not api.jobs.has_worker(DEAD_AFTER_MS):
        raise NotReady("no worker is running; jobs are accepted, and wait until one starts")
    free_mib = shutil.disk_usage(api.settings.data_dir).free // MIB
    if free_mib < api.settings.min_free_disk_mib:
        raise NotReady(
            f"{free_mib} MiB are free on the data volume, less than CUSP_MIN_FREE_DISK_MIB "
            f"({api.settings.min_free_disk_mib}): free some space, or lower CUSP_RETENTION_H"
        )
    return Health()


@router.get(
    "/metrics",
    response_class=Response,
    responses={
        200: {"content": {CONTENT_TYPE_PLAIN_0_0_4: {"schema": {"type": "string"}}}},
        **problems(401, 403, 429),
    },
)
def metrics(api: UseApi, _: Admins) -> Response:
    """Metrics for Prometheus. If the service has API keys, the scope `admin` is needed."""
    return Response(api.metrics.exposition(), media_type=CONTENT_TYPE_PLAIN_0_0_4)


@router.get("/version")
def get_version() -> Version:
    """Get the version of the service, and how jobs are confined on this machine."""
    measures = available()
    sandbox = SandboxMeasures(
        landlock=measures.landlock,
        system_calls_filtered=measures.system_calls,
        missing=measures.missing,
    )
    return Version(version=version.VERSION, sandbox=sandbox)


@router.get("/v1/limits", responses=problems(401, 403, 429))
def limits(api: UseApi, caller: Reads) -> Limits:
    """Get the limits of this server."""
    return Limits(
        max_upload_mib=api.settings.max_upload_mib,
        job_time_limit_s=api.settings.job_time_limit_s,
        job_memory_limit_mib=api.settings.job_memory_limit_mib,
        job_disk_limit_mib=api.settings.job_disk_limit_mib,
        queue_limit=api.settings.queue_limit,
        tenant_queue_limit=api.settings.tenant_queue_limit,
        tenant_quota_mib=api.settings.tenant_quota_mib,
        tenant_stored_mib=round(api.jobs.stored_bytes(caller.tenant) / MIB, 3),
        rate_limit_per_s=api.settings.rate_limit_per_s,
        parallel_jobs=api.settings.jobs,
        job_types=list(JOB_TYPES),
        formats=[each.value for each in Format],
        setting_ceilings=api.settings.ceilings,
    )
