"""Tenants take turns: who sent a thousand jobs first does not keep the others waiting, and nobody starves."""

import json
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from sqlalchemy import delete

from service.contract.schemas import Status
from service.jobs.models import JobRow, new_id
from service.jobs.store import JobStore
from service.settings import ServiceSettings
from service.storage.database import migrate, open_database
from tests.support.service import Service

pytestmark = pytest.mark.storages


def add(jobs: JobStore, tenant: str) -> JobRow:
    row = JobRow(id=new_id(), tenant=tenant, type="registration", inputs={}, options={}, attempt=0, crashes=0)
    jobs.add(row)
    return row


def serve(jobs: JobStore, waiting: list[JobRow]) -> JobRow:
    """What the queue does: the least turn first, of equals the oldest."""
    row = min(waiting, key=lambda each: (each.rank, each.id))
    waiting.remove(row)
    claimed = jobs.claim(row.id, "w")
    assert claimed is not None and jobs.succeed(row.id, claimed.attempt, [])
    return row


def test_a_tenant_with_one_job_waits_for_one_of_the_others(settings: ServiceSettings) -> None:
    engine = open_database(settings.database)
    jobs = JobStore(engine)
    waiting = [add(jobs, "many") for _ in range(50)]
    for _ in range(10):
        serve(jobs, waiting)
    waiting.append(add(jobs, "one"))
    order = [serve(jobs, waiting).tenant for _ in range(3)]
    assert "one" in order[:2]
    # and one that always has a job waiting gets every second place, not all
    waiting.append(add(jobs, "one"))
    order = []
    for _ in range(20):
        order.append(serve(jobs, waiting).tenant)
        if order[-1] == "one":
            waiting.append(add(jobs, "one"))
    assert 9 <= order.count("one") <= 11
    engine.dispose()


@pytest.fixture(scope="module")
def of_module(tmp_path_factory: pytest.TempPathFactory) -> Any:
    url = f"sqlite:///{tmp_path_factory.mktemp('fair') / 'cusp.db'}"
    migrate(url)
    engine = open_database(url)
    yield engine
    engine.dispose()


@given(st.lists(st.sampled_from(["a", "b", "c", "serve"]), max_size=40))
def test_each_tenants_jobs_keep_their_order_and_shares_are_even(of_module: Any, script: list[str]) -> None:
    with of_module.begin() as connection:
        connection.execute(delete(JobRow))
    jobs, waiting = JobStore(of_module), []
    served: list[JobRow] = []
    for word in script:
        if word != "serve":
            waiting.append(add(jobs, word))
        elif waiting:
            served.append(serve(jobs, waiting))
    # from here on nothing is added: while several tenants wait, none gets two places more than another
    begun = dict.fromkeys({row.tenant for row in waiting}, 0)
    while len({row.tenant for row in waiting}) == len(begun) > 1:
        row = serve(jobs, waiting)
        served.append(row)
        begun[row.tenant] += 1
        assert max(begun.values()) - min(begun.values()) <= 2, [(each.tenant, each.rank) for each in waiting]
    for tenant in "abc":
        ids = [row.id for row in served if row.tenant == tenant]
        assert ids == sorted(ids)


def test_the_queue_is_told_the_turn_and_one_tenants_limit_leaves_room_for_others(service: Service) -> None:
    ids = [service.submitted() for _ in range(3)]
    turns = [service.jobs.find(job_id).rank for job_id in ids]  # type: ignore[union-attr]
    assert turns == [1, 2, 3]
    assert service.waiting == ids
    assert service.queue.turns == dict(zip(ids, turns, strict=True))


def test_a_tenants_own_limit_is_a_429(service: Service) -> None:
    object.__setattr__(service.settings, "tenant_queue_limit", 2)  # frozen: of this test's service only
    for _ in range(2):
        service.submitted()
    answer = service.submit()
    assert (answer.status_code, answer.json()["code"]) == (429, "tenant_queue_full")
    assert int(answer.headers["Retry-After"]) > 0
    assert service.jobs.count(Status.ACCEPTED) == 2
    assert json.loads(service.http.get("/v1/limits").content)["tenant_queue_limit"] == 2
