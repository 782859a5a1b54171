"""From a ticket to a final row, with a scripted child; and what the reaper finds afterwards."""

import threading
import time
from pathlib import Path
from typing import Any

import obstore
import pytest
from sqlalchemy import text

from service.contract.schemas import Status
from service.execution.results_outcome import MAX_RESULTS_BYTES, RESULTS_FILE
from service.execution.sandbox import Outcome, SandboxError
from service.jobs.models import MAX_CRASHES, now_ms
from service.jobs.reaper import DEAD_AFTER_MS, LOST_AFTER_MS, Reaper
from service.jobs.store import JobStore
from service.storage.database import open_database
from tests.support.service import TRIANGLE_OBJ, Service

pytestmark = pytest.mark.storages


def test_the_child_is_given_the_meshes_and_everything_that_was_asked(service: Service) -> None:
    seen: dict[str, Any] = {}

    def act(task: dict[str, Any], on_progress: Any, is_wanted: Any) -> Outcome:
        seen.update(task, design_content=Path(task["design"]["path"]).read_bytes())
        return service.sandbox.succeed(task, on_progress, is_wanted)

    service.sandbox.act = act
    service.finished(
        '{"units": {"scan": "m"}, "tolerance_mm": 0.2, "scan_accuracy_mm": 0.03, "seed": 9,'
        ' "design_part": "2", "columns": "id,x,y,z", "acceptance": {"tolerance_mm": 0.3},'
        ' "alignment": {"kind": "best_fit"},'
        ' "reference": {"serial": "A-17"}}'
    )
    assert seen["design_content"] == TRIANGLE_OBJ
    assert (seen["design"]["unit"], seen["scan"]["unit"]) == ("auto", "m")
    assert (seen["design"]["filename"], seen["tolerance_mm"], seen["seed"]) == ("d.obj", 0.2, 9)
    assert seen["scan_accuracy_mm"] == 0.03
    assert seen["alignment"]["kind"] == "best_fit"
    assert (seen["acceptance"]["tolerance_mm"], seen["reference"]["serial"]) == (0.3, "A-17")
    assert (seen["design"]["part"], seen["scan"]["columns"]) == ("2", "id,x,y,z")
    assert list(service.settings.scratch_dir.iterdir()) == []


def test_progress_is_seen_while_the_job_runs(service: Service) -> None:
    def act(task: dict[str, Any], on_progress: Any, is_wanted: Any) -> Outcome:
        on_progress("geodesics", 31.4159, "distances on the scan")
        deadline = time.monotonic() + 10
        while (status := service.status(job_id))["stage"] is None:
            assert time.monotonic() < deadline, "no progress was written"
        assert (status["status"], status["stage"], status["progress"]) == ("running", "geodesics", 31.4)
        assert status["message"] == "distances on the scan"
        return service.sandbox.succeed(task, on_progress, is_wanted)

    service.sandbox.act = act
    job_id = service.submitted()
    service.worker.run(job_id)
    assert service.status(job_id)["status"] == "successful"


def test_a_slow_database_delays_no_job(service: Service, monkeypatch: pytest.MonkeyPatch) -> None:
    """Progress is written by the heartbeat alone, the newest: a write may last as long as it likes."""
    beat, released, begun = JobStore.beat, threading.Event(), threading.Event()

    def slow(*given: Any, **progress: Any) -> bool:
        begun.set()
        assert released.wait(60)
        return beat(*given, **progress)

    def act(task: dict[str, Any], on_progress: Any, is_wanted: Any) -> Outcome:
        for percent in range(100):
            on_progress("geodesics", float(percent), "distances")
            assert begun.wait(10) and not released.is_set() and is_wanted()
        return service.sandbox.succeed(task, on_progress, is_wanted)

    monkeypatch.setattr(JobStore, "beat", slow)
    service.sandbox.act = act
    job_id = service.submitted()
    service.worker.run(job_id)
    assert not released.is_set()  # it is published although no write of its progress came back
    status = service.status(job_id)
    assert (status["status"], status["stage"], status["progress"]) == ("successful", "report", 100.0)
    released.set()


@pytest.mark.parametrize("where", ["out", "results.json"])
def test_a_job_cannot_publish_what_a_link_leads_to(service: Service, where: str, tmp_path: Path) -> None:
    (tmp_path / "results.json").write_text("results of another tenant")

    def act(task: dict[str, Any], on_progress: Any, is_wanted: Any) -> Outcome:
        out = Path(task["out"])
        if where == "out":
            out.symlink_to(tmp_path)
        else:
            out.mkdir()
            (out / "results.json").symlink_to(tmp_path / "results.json")
        return Outcome("done", None, 0.1, None)

    service.sandbox.act = act
    assert service.status(service.finished())["error"]["code"] == "job_crashed"


def test_a_job_learns_no_names_that_a_link_leads_to(service: Service, tmp_path: Path) -> None:
    """The names of the faces of a design are shown to the tenant whose job left them."""
    (tmp_path / "design.brep_faces.csv").write_text("number,name\n0,bore of another tenant\n")

    def act(task: dict[str, Any], on_progress: Any, is_wanted: Any) -> Outcome:
        Path(task["out"]).symlink_to(tmp_path)
        return Outcome("done", None, 0.1, None)

    service.sandbox.act = act
    service.finished()
    stored = [entry["path"] for entries in obstore.list(service.blobs.store) for entry in entries]
    assert [path for path in stored if path.endswith(".faces.json")] == []


def test_a_worker_reads_no_results_of_any_size(service: Service) -> None:
    def act(task: dict[str, Any], on_progress: Any, is_wanted: Any) -> Outcome:
        out = Path(task["out"])
        out.mkdir()
        with (out / RESULTS_FILE).open("wb") as file:
            file.truncate(MAX_RESULTS_BYTES + 1)
        return Outcome("done", None, 0.1, None)

    service.sandbox.act = act
    assert service.status(service.finished())["error"]["code"] == "job_crashed"


def test_a_child_without_results_crashed(service: Service) -> None:
    service.sandbox.act = lambda *_: Outcome("done", None, 0.1, None)
    assert service.status(service.finished())["error"]["code"] == "job_crashed"


def test_a_mistake_in_the_worker_fails_the_job_with_an_id(service: Service) -> None:
    def act(*_: Any) -> Outcome:
        raise ZeroDivisionError("secret of the implementation")

    service.sandbox.act = act
    error = service.status(service.finished())["error"]
    assert error["code"] == "internal_error"
    assert error["instance"] in error["detail"]
    assert "secret" not in str(error)


def test_what_a_dismissed_job_published_is_removed(service: Service) -> None:
    def act(task: dict[str, Any], on_progress: Any, is_wanted: Any) -> Outcome:
        service.http.delete(f"/v1/jobs/{job_id}")
        return service.sandbox.succeed(task, on_progress, is_wanted)

    service.sandbox.act = act
    job_id = service.submitted()
    service.worker.run(job_id)
    assert service.status(job_id)["status"] == "dismissed"
    assert not list(service.settings.blob_dir.glob("results/*/*/*"))


@pytest.mark.parametrize("breaks", [False, True])
def test_a_worker_that_ends_hands_its_job_back(service: Service, breaks: bool) -> None:
    begun, ended = threading.Event(), threading.Event()

    def act(task: Any, on_progress: Any, is_wanted: Any) -> Outcome:
        begun.set()
        if breaks:
            raise SandboxError("a system library is missing")
        while is_wanted():
            ended.wait(0.01)
        return Outcome("unwanted", None, 0.1, None)

    service.sandbox.act = act
    job_id = service.submitted()
    # The thread never returns: the ticket must not be used up. The process would end now.
    threading.Thread(target=service.worker.run, args=[job_id], daemon=True).start()
    assert begun.wait(5)
    assert service.worker.stop(5)
    status = service.status(job_id)
    assert (status["status"], status["attempt"], status["started"]) == ("accepted", 1, None)
    assert (service.worker.broken is not None) == breaks


# --- the reaper


def age(service: Service, monkeypatch: pytest.MonkeyPatch, ms: int) -> None:
    """Let so much time go by."""
    monkeypatch.setattr(JobStore, "now_ms", lambda _: now_ms() + ms)


def test_a_job_whose_ticket_was_lost_gets_another(service: Service, monkeypatch: pytest.MonkeyPatch) -> None:
    job_id = service.submitted()
    assert service.waiting == [job_id]
    service.queue.waiting.clear()
    reaper = Reaper(service.jobs, service.queue)
    reaper.sweep()
    assert service.waiting == []
    age(service, monkeypatch, LOST_AFTER_MS + 1000)
    reaper.sweep()
    assert service.waiting == [job_id]


def test_a_ticket_that_a_gone_worker_holds_is_made_anew(
    service: Service, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It was handed back, and its worker does not come again."""
    held, waits = service.submitted(), service.submitted()
    assert service.waiting == [held, waits]
    made: list[str] = []
    monkeypatch.setattr(service.queue, "entries", lambda: {held: "worker-7", waits: None})
    monkeypatch.setattr(service.queue, "requeue", lambda job_id, turn: made.append(job_id))
    age(service, monkeypatch, LOST_AFTER_MS + 1000)
    service.jobs.worker_beat("worker-7")
    Reaper(service.jobs, service.queue).sweep()
    assert made == []
    service.jobs.worker_gone("worker-7")
    Reaper(service.jobs, service.queue).sweep()
    assert made == [held]


def test_a_dismissed_jobs_ticket_is_taken_back(service: Service) -> None:
    ids = [service.submitted() for _ in range(3)]
    assert service.waiting == ids
    service.http.delete(f"/v1/jobs/{ids[1]}")
    assert service.waiting == [ids[0], ids[2]]


def test_a_silent_workers_job_is_handed_on(service: Service, monkeypatch: pytest.MonkeyPatch) -> None:
    job_id = service.submitted()
    assert service.waiting == [job_id]
    service.queue.waiting.clear()
    service.jobs.claim(job_id, "worker-2")
    reaper = Reaper(service.jobs, service.queue)
    reaper.sweep()
    assert service.status(job_id)["status"] == "running"
    age(service, monkeypatch, DEAD_AFTER_MS + 1000)
    reaper.sweep()
    assert service.status(job_id)["status"] == "accepted"
    assert service.waiting == [job_id]


def test_a_clock_that_is_set_forward_takes_no_worker_for_dead(
    service: Service, monkeypatch: pytest.MonkeyPatch
) -> None:
    job_id = service.submitted()
    row = service.jobs.claim(job_id, "worker-2")
    assert row is not None
    reaper = Reaper(service.jobs, service.queue, clock_may_jump=True)
    age(service, monkeypatch, DEAD_AFTER_MS + 60_000)  # before the next heartbeat
    for _ in range(2):
        reaper.sweep()
        assert service.status(job_id)["status"] == "running"
        time.sleep(0.002)
        assert service.jobs.beat(job_id, row.attempt)
    for expected in ("running", "accepted"):  # no heartbeat any more
        reaper.sweep()
        assert service.status(job_id)["status"] == expected


def test_one_bad_row_hides_no_other_and_stops_no_start(service: Service) -> None:
    """Damaged by hand, or of a later version: the others are handed on, and the start goes on."""
    bad, good = service.submitted(), service.submitted()
    for job_id in (bad, good):
        assert service.jobs.claim(job_id, "worker-1") is not None
    engine = open_database(service.settings.database)
    with engine.begin() as connection:
        damaged = '"no object"' if service.settings.is_embedded else "[1]"
        connection.execute(text("UPDATE jobs SET inputs = :x WHERE id = :id"), {"x": damaged, "id": bad})
        connection.execute(text("UPDATE jobs SET type = 'of_a_later_version' WHERE id = :id"), {"id": bad})
        if service.settings.is_embedded:
            connection.execute(text("UPDATE jobs SET options = '{' WHERE id = :id"), {"id": bad})
    engine.dispose()
    reaper = Reaper(service.jobs, service.queue)
    reaper.at_start("worker-1")
    reaper.sweep()
    assert service.status(good)["status"] == "accepted"
    service.worker.run(good)
    service.worker.run(bad)
    assert service.status(good)["status"] == "successful"


def test_a_job_that_takes_workers_along_is_given_up(service: Service) -> None:
    job_id = service.submitted()
    for _ in range(MAX_CRASHES):
        assert service.jobs.claim(job_id, "worker-1") is not None
        Reaper(service.jobs, service.queue).at_start("worker-1")
    status = service.status(job_id)
    assert (status["status"], status["attempt"]) == (Status.FAILED, MAX_CRASHES)
    assert "workers died" in status["error"]["detail"]
