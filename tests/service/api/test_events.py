"""A job watched as server-sent events, over real HTTP."""

import itertools
import json
import threading
from typing import Any

from service.execution.sandbox import Outcome
from tests.support.service import Service


def events_of(service: Service, job_id: str) -> list[dict[str, Any]]:
    """All of them, until the stream ends."""
    with service.http.stream("GET", f"/v1/jobs/{job_id}/events") as answer:
        assert answer.status_code == 200
        assert answer.headers["content-type"].startswith("text/event-stream")
        lines = [line for line in answer.iter_lines() if not line.startswith(":")]
    assert lines.count("event: status") == len([line for line in lines if line.startswith("data: ")])
    return [json.loads(line.removeprefix("data: ")) for line in lines if line.startswith("data: ")]


def test_every_change_is_told_once_and_the_last_is_final(service: Service) -> None:
    seen_running = threading.Event()

    def act(task: dict[str, Any], on_progress: Any, is_wanted: Any) -> Outcome:
        on_progress("geodesics", 31.0, "distances on the scan")
        assert seen_running.wait(20)
        return service.sandbox.succeed(task, on_progress, is_wanted)

    service.sandbox.act = act
    job_id = service.submitted()
    told: list[dict[str, Any]] = []
    watcher = threading.Thread(target=lambda: told.extend(events_of(service, job_id)))
    watcher.start()
    worker = threading.Thread(target=service.worker.run, args=(job_id,))
    worker.start()
    threading.Timer(1.0, seen_running.set).start()
    worker.join(30)
    watcher.join(30)
    assert told[-1]["status"] == "successful"
    assert told[-1]["progress"] == 100.0
    assert all(first != second for first, second in itertools.pairwise(told))
    assert "running" in {job["status"] for job in told}
    assert [job["progress"] for job in told] == sorted(job["progress"] for job in told)


def test_a_final_job_is_told_once_and_the_stream_ends(service: Service) -> None:
    job_id = service.finished()
    (only,) = events_of(service, job_id)
    assert only == service.status(job_id)


def test_a_job_that_is_not_there_is_a_problem_and_no_stream(service: Service) -> None:
    answer = service.http.get("/v1/jobs/none/events")
    assert (answer.status_code, answer.json()["code"]) == (404, "job_not_found")
