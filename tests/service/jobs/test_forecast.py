"""How long a job will take: closed forms, and one history in the tables."""

import pytest

from service.contract.schemas import Status
from service.jobs.forecast import MIN_JOBS, seconds_left, seconds_until_start
from service.jobs.models import JobRow, new_id
from service.jobs.store import JobStore
from service.settings import ServiceSettings
from service.storage.database import open_database

pytestmark = pytest.mark.storages


def test_what_is_left_is_the_median_of_those_that_ran_longer() -> None:
    assert seconds_left([10, 20, 30], 0) == 20
    assert seconds_left([10, 20, 30], 15) == 10  # of 20 and 30
    assert seconds_left([10, 20, 30], 30) is None


def test_a_job_starts_when_a_place_is_free() -> None:
    assert seconds_until_start([], 0, 60) == 0
    assert seconds_until_start([5.0], 2, 60) == 125
    assert seconds_until_start([5.0, 25.0], 1, 60) == 25  # the one before it starts after 5 s
    assert seconds_until_start([5.0, 25.0], 3, 60) == 85


class Tables:
    """Jobs as they are stored, at times that the test sets."""

    def __init__(self, settings: ServiceSettings) -> None:
        self.now = 1_000_000
        self.engine = open_database(settings.database)
        self.store = JobStore(self.engine, lambda: self.now)

    def waiting(self, mesh: str, size: int, job_type: str = "landmarks") -> JobRow:
        self.store.add_blob(mesh, size, "stl", "default")
        inputs = {"mesh": {"blob": mesh, "filename": "a.stl"}}
        row = JobRow(id=new_id(), type=job_type, inputs=inputs, options={}, attempt=0, crashes=0)
        self.store.add(row)
        return row

    def ended(self, mesh: str, size: int, seconds: float) -> None:
        row = self.waiting(mesh, size)
        self.store.claim(row.id, "w")
        self.now += int(1000 * seconds)
        assert self.store.succeed(row.id, 1, [])

    def forecast(self, row: JobRow) -> tuple[float, int | None, float | None, int]:
        stored = self.store.find(row.id)
        assert stored is not None
        found = self.store.forecast(stored)
        return (found.elapsed_s, found.ahead, found.left_s, found.based_on)


def test_the_estimate_is_of_jobs_of_the_same_kind_and_size(settings: ServiceSettings) -> None:
    tables = Tables(settings)
    first = tables.waiting("sha256:m", 1000)
    tables.now += 2000
    assert tables.forecast(first) == (2.0, 0, None, 0)  # none was seen yet
    assert tables.store.dismiss(first.id, Status.ACCEPTED)
    for seconds in (10, 20, 60):
        tables.ended("sha256:m", 1000, seconds)
    tables.ended("sha256:large", 100_000, 600)
    one, two = tables.waiting("sha256:n", 1900), tables.waiting("sha256:n", 1900)
    assert tables.store.claim(one.id, "w")
    tables.now += 15_000
    assert tables.forecast(one) == (15.0, None, 25.0, MIN_JOBS)  # of 20 and 60
    # The running one leaves the median of all, 40, after 25 more; two takes the median of its like, 20.
    assert tables.forecast(two) == (15.0, 0, 45.0, MIN_JOBS)
    three = tables.waiting("sha256:n", 1900)
    assert tables.forecast(three) == (0.0, 1, 85.0, MIN_JOBS)
    study = tables.waiting("sha256:n", 1900, "study")
    assert tables.forecast(study)[1:] == (2, None, 0)
    assert tables.store.dismiss(one.id, Status.RUNNING)
    assert tables.forecast(one) == (15.0, None, 0.0, 0)
    tables.engine.dispose()
