"""Stores that are away, answers that are lost, and workers that come back too late: no job is lost, and
nobody's files go.
"""

import errno
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import obstore
import pytest
from obstore.exceptions import GenericError
from sqlalchemy.exc import OperationalError

from service.contract.errors import JobCrashed, problem_of
from service.execution.heartbeat import Heartbeat
from service.execution.sandbox import Outcome
from service.execution.worker import Worker
from service.jobs.models import now_ms
from service.jobs.reaper import DEAD_AFTER_MS, Reaper
from service.jobs.store import JobStore
from tests.support.service import RESULTS, Service

pytestmark = pytest.mark.storages


@pytest.fixture(autouse=True)
def _impatient(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("service.storage.retry.PAUSE_S", 0.01)
    monkeypatch.setattr("service.execution.heartbeat.JOB_HEARTBEAT_S", 0.01)


def failing_first(
    times: int, act: Callable[..., Any], error: Exception, *, after: bool = False
) -> Callable[..., Any]:
    """`act`, whose first calls fail: before it is done, or after, so that only the answer is lost."""
    left = [times]

    def acting(*given: Any, **named: Any) -> Any:
        if left[0] > 0:
            left[0] -= 1
            if after:
                act(*given, **named)
            raise error
        return act(*given, **named)

    return acting


def lost_connection() -> OperationalError:
    return OperationalError("COMMIT", {}, Exception("server closed the connection unexpectedly"))


def files_of_all_attempts(service: Service, job_id: str) -> set[str]:
    batches = obstore.list(service.blobs.store, prefix=f"results/{job_id}")
    return {entry["path"].removeprefix(f"results/{job_id}/") for batch in batches for entry in batch}


def test_a_worker_that_comes_back_too_late_leaves_the_published_files_alone(
    service: Service, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its job was handed on, the second attempt has published, and only then the first one ends well."""
    monkeypatch.setattr("service.execution.heartbeat.JOB_HEARTBEAT_S", 60)  # it slept: it does not know

    def act(task: dict[str, Any], on_progress: Any, is_wanted: Any) -> Outcome:
        if service.sandbox.tasks[0] is not task:
            return service.sandbox.succeed(task, on_progress, is_wanted)
        monkeypatch.setattr(JobStore, "now_ms", lambda _: now_ms() + DEAD_AFTER_MS + 1000)
        Reaper(service.jobs, service.queue).sweep()
        service.worker.run(job_id)
        assert service.status(job_id)["attempt"] == 2
        return service.sandbox.succeed(task, on_progress, is_wanted)

    service.sandbox.act = act
    job_id = service.submitted()
    service.worker.run(job_id)
    assert (service.status(job_id)["status"], service.status(job_id)["attempt"]) == ("successful", 2)
    assert service.http.get(f"/v1/jobs/{job_id}/results").content == RESULTS
    assert service.http.get(f"/v1/jobs/{job_id}/files/aligned.ply").content == b"ply\n"
    assert files_of_all_attempts(service, job_id) == {"2/results.json", "2/aligned.ply"}


def test_a_publication_whose_answer_is_lost_is_one(service: Service, monkeypatch: pytest.MonkeyPatch) -> None:
    """The commit arrived at the database, its answer did not arrive here."""
    succeed = service.jobs.succeed
    monkeypatch.setattr(service.jobs, "succeed", failing_first(1, succeed, lost_connection(), after=True))
    job_id = service.finished()
    assert service.status(job_id)["status"] == "successful"
    assert service.http.get(f"/v1/jobs/{job_id}/results").content == RESULTS
    assert service.http.get(f"/v1/jobs/{job_id}/files/aligned.ply").content == b"ply\n"


def test_a_publication_that_was_removed_at_once_leaves_nothing(
    service: Service, monkeypatch: pytest.MonkeyPatch
) -> None:
    succeed = service.jobs.succeed

    def succeed_and_be_removed(*given: Any, **named: Any) -> bool:
        assert succeed(*given, **named)
        assert service.http.delete(f"/v1/jobs/{given[0]}").status_code == 204
        return False

    monkeypatch.setattr(service.jobs, "succeed", succeed_and_be_removed)
    job_id = service.finished()
    assert service.http.get(f"/v1/jobs/{job_id}").status_code == 404
    assert files_of_all_attempts(service, job_id) == set()


@pytest.mark.parametrize("slow", ["fetch", "publish"])
def test_a_job_is_heard_of_while_its_bytes_come_and_go(
    service: Service, monkeypatch: pytest.MonkeyPatch, slow: str
) -> None:
    """A slow bucket is no dead worker."""
    act = getattr(service.blobs, slow)

    def acting(*given: Any) -> Any:
        row = service.jobs.find(job_id)
        assert row is not None and row.heartbeat_ms is not None
        first, deadline = row.heartbeat_ms, time.monotonic() + 10
        while (now := service.jobs.find(job_id)) is None or (now.heartbeat_ms or 0) <= first:
            assert time.monotonic() < deadline, "no beat came"
            time.sleep(0.01)
        return act(*given)

    monkeypatch.setattr(service.blobs, slow, acting)
    job_id = service.submitted()
    service.worker.run(job_id)
    assert service.status(job_id)["status"] == "successful"


def test_a_job_that_is_dismissed_while_it_is_fetched_is_not_computed_on(
    service: Service, monkeypatch: pytest.MonkeyPatch
) -> None:
    fetch = service.blobs.fetch

    def fetching(*given: Any) -> None:
        if service.status(job_id)["status"] == "running":
            service.http.delete(f"/v1/jobs/{job_id}")
        fetch(*given)

    def act(task: dict[str, Any], on_progress: Any, is_wanted: Callable[[], bool]) -> Outcome:
        deadline = time.monotonic() + 10
        while is_wanted():
            assert time.monotonic() < deadline, "it was not told"
            time.sleep(0.01)
        return Outcome("unwanted", None, 0.1, None)

    monkeypatch.setattr(service.blobs, "fetch", fetching)
    service.sandbox.act = act
    job_id = service.submitted()
    service.worker.run(job_id)
    assert service.status(job_id)["status"] == "dismissed"


@pytest.mark.parametrize("what", ["fetch", "publish"])
@pytest.mark.parametrize(
    "error", [GenericError("503 SlowDown"), OSError("connection reset"), OSError(28, "no space")]
)
def test_a_store_that_is_away_for_a_while_costs_no_job(
    service: Service, monkeypatch: pytest.MonkeyPatch, what: str, error: Exception
) -> None:
    monkeypatch.setattr(service.blobs, what, failing_first(2, getattr(service.blobs, what), error))
    status = service.status(service.finished())
    assert (status["status"], status["attempt"]) == ("successful", 1)


@pytest.mark.parametrize("what", ["fetch", "publish"])
def test_a_store_that_stays_away_has_the_job_wait_again(
    service: Service, monkeypatch: pytest.MonkeyPatch, what: str
) -> None:
    monkeypatch.setattr("service.storage.retry.RETRY_LIMIT_S", 0.0)
    act = getattr(service.blobs, what)
    monkeypatch.setattr(service.blobs, what, failing_first(1, act, GenericError("no route to host")))
    job_id = service.finished()
    row = service.jobs.find(job_id)
    assert row is not None and (row.status, row.crashes) == ("accepted", 0)
    service.worker.run(job_id)  # the reaper adds another queue entry
    assert service.status(job_id)["status"] == "successful"


@pytest.mark.parametrize("what", ["fetch", "publish"])
@pytest.mark.parametrize(
    "error",
    [
        OSError(errno.EMFILE, "too many open files"),
        BlockingIOError(errno.EAGAIN, "fork"),
        MemoryError(),
        RuntimeError("can't start new thread"),
    ],
)
def test_a_machine_without_room_for_a_while_costs_no_job(
    service: Service, monkeypatch: pytest.MonkeyPatch, what: str, error: Exception
) -> None:
    monkeypatch.setattr(service.blobs, what, failing_first(1, getattr(service.blobs, what), error))
    status = service.status(service.finished())
    assert (status["status"], status["attempt"]) == ("successful", 1)


def test_a_job_without_a_thread_for_its_heartbeat_waits_again(
    service: Service, monkeypatch: pytest.MonkeyPatch
) -> None:
    start = failing_first(1, Heartbeat.__enter__, RuntimeError("can't start new thread"))
    monkeypatch.setattr(Heartbeat, "__enter__", start)
    job_id = service.finished()
    row = service.jobs.find(job_id)
    assert row is not None and (row.status, row.crashes) == ("accepted", 0)
    service.worker.run(job_id)
    assert service.status(job_id)["status"] == "successful"


def test_a_mesh_that_is_gone_fails_its_job_by_name(service: Service) -> None:
    job_id = service.submitted()
    row = service.jobs.find(job_id)
    assert row is not None
    service.blobs.remove(row.inputs["scan"]["blob"], older_than_ms=2**52)
    service.worker.run(job_id)
    error = service.status(job_id)["error"]
    assert error["code"] == "unknown_blob" and error["detail"].startswith("design: ")  # they are one blob


def test_a_cache_of_designs_that_is_away_costs_no_job(
    service: Service, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(name: str, path: Path) -> bool:
        path.write_bytes(b"half of it")
        raise GenericError("503 SlowDown")

    def act(task: dict[str, Any], on_progress: Any, is_wanted: Any) -> Outcome:
        assert not task["design_known"] and not Path(task["design_cache"]).exists()
        return service.sandbox.succeed(task, on_progress, is_wanted)

    monkeypatch.setattr(service.worker._tasks._designs, "fetch", fail)
    service.sandbox.act = act
    assert service.status(service.finished())["status"] == "successful"


def test_a_worker_that_stops_waits_for_no_store(service: Service, monkeypatch: pytest.MonkeyPatch) -> None:
    begun = threading.Event()

    def fail(*_: Any) -> None:
        begun.set()
        raise GenericError("no route to host")

    monkeypatch.setattr(service.blobs, "fetch", fail)
    job_id = service.submitted()
    threading.Thread(target=service.worker.run, args=[job_id], daemon=True).start()
    assert begun.wait(5)
    assert service.worker.stop(5)
    assert service.status(job_id)["status"] == "accepted"
    assert [row.id for row in service.worker.released] == [job_id]


def test_what_the_database_tells_of_is_on_the_disk_before_it(
    service: Service, monkeypatch: pytest.MonkeyPatch
) -> None:
    """After a loss of power an accepted job has its meshes, and a successful one its files."""
    settled: set[str] = set()
    told: list[tuple[str, set[str]]] = []

    def noting(file: int) -> None:
        settled.add(str(Path(f"/proc/self/fd/{file}").readlink()))

    def seen(name: str, act: Callable[..., Any]) -> Callable[..., Any]:
        def acting(*given: Any, **named: Any) -> Any:
            told.append((name, set(settled)))
            return act(*given, **named)

        return acting

    monkeypatch.setattr("service.storage.durable.os.fsync", noting)
    monkeypatch.setattr("service.jobs.store.JobStore.add", seen("accepted", JobStore.add))
    monkeypatch.setattr("service.jobs.store.JobStore.succeed", seen("successful", JobStore.succeed))
    job_id = service.finished()
    assert [name for name, _ in told] == ["accepted", "successful"]
    if not service.settings.is_embedded:
        assert settled == set()  # a bucket answers when it has it
        return
    folder = service.settings.blob_dir
    (blob,) = (path for path in folder.glob("blobs/*/*"))
    assert {str(blob.parent), str(blob.parent.parent), str(folder)} <= told[0][1]
    assert any("/incoming/" in path for path in told[0][1])  # its content, before it got its name
    out = folder / "results" / job_id / "1"
    assert {str(out), str(out.parent), *map(str, out.iterdir())} <= told[1][1]


@pytest.mark.parametrize("fills_it_itself", [False, True])
def test_a_job_that_dies_of_a_full_disk_runs_again_when_there_is_room(
    service: Service, monkeypatch: pytest.MonkeyPatch, fills_it_itself: bool
) -> None:
    """In the same attempt. One that dies of it again and again has filled it, and fails."""
    ends: list[str] = []
    waits_for_room = Worker._check_room

    def somebody_makes_room(worker: Worker) -> None:
        with pytest.raises(OSError, match="no room"):
            waits_for_room(worker)
        monkeypatch.setattr("service.execution.worker.FULL_BYTES", 0)

    def act(task: dict[str, Any], on_progress: Any, is_wanted: Any) -> Outcome:
        if ends and not fills_it_itself:
            return service.sandbox.succeed(task, on_progress, is_wanted)
        ends.append("died")
        monkeypatch.setattr("service.execution.worker.FULL_BYTES", 2**62)  # what is free is too little
        return Outcome("failed", problem_of(JobCrashed("exited without an answer")), 0.1, None)

    service.sandbox.act = act
    monkeypatch.setattr(Worker, "_check_room", somebody_makes_room)
    job_id = service.finished()
    job = service.status(job_id)
    if fills_it_itself:
        assert (job["status"], job["error"]["code"], len(ends)) == ("failed", "job_crashed", 3)
    else:
        assert (job["status"], job["attempt"], len(ends)) == ("successful", 1, 1)
