"""Requests that are stored at the same time do not exceed the limits of the queue together."""

import threading

import pytest

from service.contract.errors import QueueFull, TenantQueueFull
from service.jobs.admission import QueueLimits
from service.jobs.batches import BatchRow
from service.jobs.models import JobRow, new_id
from tests.support.service import Service

pytestmark = pytest.mark.storages


def job(tenant: str = "acme") -> JobRow:
    return JobRow(id=new_id(), tenant=tenant, type="study", inputs={}, options={}, attempt=0, crashes=0)


def store(service: Service, kind: str, limits: QueueLimits) -> None:
    match kind:
        case "one":
            service.jobs.add(job(), limits)
        case "with a key":
            service.jobs.add_once(job(), new_id(), "sha256", limits)
        case "batch":
            batch = BatchRow(id=new_id(), tenant="acme", total=1)
            service.jobs.add_batch(batch, [job()], None, "sha256", limits)


@pytest.mark.parametrize("kind", ["one", "with a key", "batch"])
def test_of_requests_at_once_no_more_than_the_limit_are_stored(service: Service, kind: str) -> None:
    limits, start, refused = QueueLimits(3, 100), threading.Barrier(8), []

    def send() -> None:
        start.wait()
        try:
            store(service, kind, limits)
        except TenantQueueFull as error:
            refused.append(error)

    threads = [threading.Thread(target=send) for _ in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert (service.jobs.count("accepted", "acme"), len(refused)) == (3, 5)
    with pytest.raises(QueueFull):
        service.jobs.add(job("another"), QueueLimits(3, 3))
    assert service.jobs.count("accepted") == 3
