"""The parts that handlers use, opened once by `app.create_app` and closed with it."""

from dataclasses import dataclass
from typing import Annotated, cast

from fastapi import Depends, Request

from service.api.arriving import Arriving
from service.api.batched import Batched
from service.api.job_watch import JobWatch
from service.auth.keys import Caller, KeyStore
from service.auth.rate_limit import Rates
from service.contract.errors import JobNotFound
from service.jobs.metrics import Metrics
from service.jobs.models import JobRow
from service.jobs.store import JobStore
from service.settings import ServiceSettings
from service.storage.blobs import BlobStore
from service.storage.design_faces import DesignFaces
from service.webhooks.address_guard import Guard
from service.webhooks.outbox import Deliveries


@dataclass(frozen=True, slots=True)
class Api:
    """The parts of one running API."""

    settings: ServiceSettings
    jobs: JobStore
    blobs: BlobStore
    design_faces: DesignFaces
    keys: KeyStore
    metrics: Metrics
    deliveries: Deliveries
    guard: Guard
    mesh_guard: Guard
    rates: Rates
    watch: JobWatch
    callers: Batched[str, Caller]
    rows: Batched[str, JobRow]
    arriving: Arriving

    def job(self, job_id: str, caller: Caller) -> JobRow:
        """The caller's job. Raises JobNotFound, also for a job of another tenant."""
        return _existing(self.jobs.get(job_id, caller.tenant), job_id)

    async def read_job(self, job_id: str, caller: Caller) -> JobRow:
        """The same with one query for all requests of the moment. The row is shared: do not change it."""
        row = await self.rows.get(job_id)
        return _existing(row if row is not None and row.tenant == caller.tenant else None, job_id)


def _existing(row: JobRow | None, job_id: str) -> JobRow:
    if row is None:
        raise JobNotFound(
            f"no job has the id {job_id!r}: check the id and the API key; ended jobs are removed after "
            "some time"
        )
    return row


async def _api_of(request: Request) -> Api:
    return cast(Api, request.app.state.api)


UseApi = Annotated[Api, Depends(_api_of)]
