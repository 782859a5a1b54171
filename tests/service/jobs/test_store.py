"""The state machine: whatever the API, workers and the reaper do in whatever order, a job makes legal moves
only.
"""

import shutil
import tempfile
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, precondition, rule

from service.contract.errors import JobCrashed, problem_of
from service.contract.schemas import Status
from service.jobs.models import MAX_CRASHES, MOVES, IllegalMove, JobRow, check_move, new_id
from service.jobs.store import JobStore
from service.storage.database import migrate, open_database

CRASHED = problem_of(JobCrashed("died"))
attempts = st.integers(0, 4)


def test_a_final_status_has_no_way_out() -> None:
    for before, after in MOVES.items():
        assert before.is_final == (not after)
    with pytest.raises(IllegalMove):
        check_move(Status.SUCCESSFUL, Status.RUNNING)


def test_ids_sort_by_time() -> None:
    ids = [new_id() for _ in range(1000)]
    assert ids == sorted(ids)


class OneJob(RuleBasedStateMachine):
    """Every call may come at any time, also from workers that were given up; the model says what may
    happen.
    """

    def __init__(self) -> None:
        super().__init__()
        self.folder = Path(tempfile.mkdtemp())
        url = f"sqlite:///{self.folder / 'cusp.db'}"
        migrate(url)
        self.engine = open_database(url)
        self.store = JobStore(self.engine)
        self.id = new_id()
        self.store.add(JobRow(id=self.id, type="registration", inputs={}, options={}, attempt=0, crashes=0))
        self.status, self.attempt, self.crashes = Status.ACCEPTED, 0, 0

    def teardown(self) -> None:
        self.engine.dispose()
        shutil.rmtree(self.folder)

    def is_mine(self, attempt: int) -> bool:
        return self.status is Status.RUNNING and attempt == self.attempt

    @rule()
    def claim(self) -> None:
        row = self.store.claim(self.id, "w")
        assert (row is not None) == (self.status is Status.ACCEPTED)
        if row is not None:
            self.status, self.attempt = Status.RUNNING, self.attempt + 1
            assert (row.attempt, row.progress) == (self.attempt, 0)

    @rule(attempt=attempts)
    def beat(self, attempt: int) -> None:
        assert self.store.beat(self.id, attempt, progress=50.0) == self.is_mine(attempt)

    @rule(attempt=attempts)
    def succeed(self, attempt: int) -> None:
        mine = self.is_mine(attempt)
        assert self.store.succeed(self.id, attempt, []) == mine
        if mine:
            self.status = Status.SUCCESSFUL

    @rule(attempt=attempts)
    def fail(self, attempt: int) -> None:
        mine = self.is_mine(attempt)
        assert self.store.fail(self.id, attempt, CRASHED) == mine
        if mine:
            self.status = Status.FAILED

    @rule(attempt=attempts)
    def release(self, attempt: int) -> None:
        mine = self.is_mine(attempt)
        assert self.store.release(self.id, attempt) == mine
        if mine:
            self.status = Status.ACCEPTED

    @precondition(lambda self: self.status is Status.RUNNING)
    @rule()
    def the_worker_dies(self) -> None:
        (job_id,) = self.store.orphans(worker="w")
        row = self.store.find(job_id)
        assert row is not None
        status = self.store.reassign(row, CRASHED)
        self.crashes += 1
        self.status = Status.FAILED if self.crashes >= MAX_CRASHES else Status.ACCEPTED
        assert status is self.status
        assert self.store.reassign(row, CRASHED) is None  # another reaper, a moment later

    @rule(before=st.sampled_from([Status.ACCEPTED, Status.RUNNING]))
    def dismiss(self, before: Status) -> None:
        fits = self.status is before
        assert self.store.dismiss(self.id, before) == fits
        if fits:
            self.status = Status.DISMISSED

    @rule()
    def remove(self) -> None:
        removed_before = self.store.get(self.id) is None
        assert self.store.remove(self.id) == (self.status.is_final and not removed_before)

    @invariant()
    def the_row_is_as_the_model(self) -> None:
        row = self.store.find(self.id)
        assert row is not None
        assert (row.status, row.attempt) == (self.status, self.attempt)
        assert (row.finished_ms is not None) == self.status.is_final
        assert (row.error is not None) == (self.status is Status.FAILED and row.removed_ms is None)


TestOneJob = OneJob.TestCase
TestOneJob.settings = settings(
    max_examples=25, stateful_step_count=15, deadline=None, suppress_health_check=list(HealthCheck)
)
