"""Assembly of the API. Importing this module has no side effects; `create_app` gets all it needs."""

from collections.abc import AsyncIterator
from contextlib import ExitStack, asynccontextmanager

from fastapi import APIRouter, FastAPI

from service import version
from service.api import problems
from service.api.arriving import Arriving
from service.api.batched import Batched
from service.api.dependencies import Api
from service.api.digests import DigestCheck
from service.api.job_notices import change_notices
from service.api.job_watch import JobWatch
from service.api.middleware.body_limit import BodyLimit
from service.api.middleware.disk_room import DiskRoom
from service.api.middleware.gunzip import Gunzip
from service.api.middleware.request_log import RequestLog
from service.api.openapi import describe
from service.api.routes import (
    batches,
    blobs,
    deliveries,
    designs,
    job_deliveries,
    job_results,
    job_status,
    page,
    service,
)
from service.api.routes import jobs as job_routes
from service.api.storage_room import check_disk
from service.auth.keys import KeyStore
from service.auth.rate_limit import Rates
from service.jobs.metrics import Metrics
from service.jobs.store import JobStore
from service.settings import MIB, ServiceSettings
from service.storage.blobs import BlobStore
from service.storage.database import open_database
from service.storage.design_faces import DesignFaces
from service.webhooks.address_guard import Guard
from service.webhooks.outbox import Deliveries

#: All routes. What FastAPI derives from them at the first request, it derives once for all applications of a
#: process: 25 ms of the processor, which tests would pay for each of theirs.
ROUTES = APIRouter()
for _part in (
    job_routes,
    job_status,
    job_results,
    job_deliveries,
    batches,
    blobs,
    designs,
    deliveries,
    service,
    page,
):
    ROUTES.include_router(_part.router)


def create_app(settings: ServiceSettings) -> FastAPI:
    """The ASGI application. The tables must be migrated already."""

    @asynccontextmanager
    async def lifespan(app: FastAPI) -> AsyncIterator[None]:
        engine = open_database(settings.database)
        with ExitStack() as stack:
            stack.callback(engine.dispose)
            jobs = JobStore(engine)
            keys = KeyStore(engine)
            watch = JobWatch(jobs, settings.tenant_watcher_limit, change_notices(settings.database))
            blob_store = BlobStore(settings.blobs)
            app.state.api = Api(
                settings,
                jobs,
                blob_store,
                DesignFaces(blob_store.store),
                keys,
                Metrics(engine, settings.data_dir),
                Deliveries(engine),
                Guard.of(settings.webhook_networks),
                Guard.of(settings.mesh_networks, "CUSP_MESH_NETWORKS"),
                Rates(settings.rate_limit_per_s),
                watch,
                Batched(keys.callers),
                Batched(jobs.kept),
                Arriving(),
            )
            yield
            await watch.close()

    app = FastAPI(title="Cusp", version=version.VERSION, lifespan=lifespan, docs_url=None, redoc_url=None)
    app.router.routes += [*ROUTES.routes, page.assets]
    # errors
    problems.install(app)
    # middleware, innermost first
    app.add_middleware(DigestCheck)
    app.add_middleware(DiskRoom, check=lambda: check_disk(app.state.api, 0))
    app.add_middleware(Gunzip, max_bytes=settings.max_upload_mib * MIB)
    app.add_middleware(BodyLimit, max_bytes=settings.max_upload_mib * MIB)
    app.add_middleware(RequestLog)
    # documentation
    describe(app)
    return app
