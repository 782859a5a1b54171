"""/metrics in Prometheus' own reading: counts add up, over processes and restarts."""

from typing import Any

import pytest
from prometheus_client.parser import text_string_to_metric_families

from service.auth.keys import KeyStore, Scope
from service.contract.errors import NotFound, problem_of
from service.execution.sandbox import Outcome
from service.execution.worker import StageClock
from service.jobs.metrics import COUNTERS, Metrics
from service.jobs.models import MAX_CRASHES
from service.jobs.reaper import Reaper
from service.storage.database import open_database
from tests.support.service import TRIANGLE_OBJ, Service

pytestmark = pytest.mark.storages

Samples = dict[tuple[str, str], float]


def samples(service: Service) -> Samples:
    answer = service.http.get("/metrics")
    assert answer.status_code == 200
    assert answer.headers["content-type"].startswith("text/plain; version=0.0.4")
    return {
        (sample.name, next(iter(sample.labels.values()), "")): sample.value
        for family in text_string_to_metric_families(answer.text)
        for sample in family.samples
    }


def test_jobs_are_counted_by_how_they_ended(service: Service) -> None:
    def fail(*_: Any) -> Outcome:
        return Outcome("failed", problem_of(NotFound("no matter")), 0.1, 250.0)

    service.finished()
    service.finished()
    service.sandbox.act = fail
    service.finished()
    service.submitted()
    found = samples(service)
    assert found["cusp_jobs_ended_total", "successful"] == 2
    assert found["cusp_jobs_ended_total", "not_found"] == 1
    assert (
        found["cusp_jobs", "accepted"],
        found["cusp_jobs", "successful"],
        found["cusp_jobs", "failed"],
    ) == (1, 2, 1)
    assert found["cusp_child_peak_mib", "registration"] == 250.0
    assert found["cusp_stage_passes_total", "report"] == 2
    assert found["cusp_stage_seconds_total", "report"] >= 0
    assert found["cusp_queue_oldest_seconds", ""] > 0
    assert found["cusp_workers_alive", ""] == 0
    assert found["cusp_disk_free_bytes", ""] > 0
    assert found["cusp_designs_total", "no"] == 3


def test_every_end_is_counted_once_and_with_its_row(service: Service) -> None:
    """Also of jobs that no worker ended: dismissed while they wait, or given up after their workers died."""
    service.http.delete(f"/v1/jobs/{service.submitted()}")
    given_up = service.submitted()
    for _ in range(MAX_CRASHES):
        assert service.jobs.claim(given_up, "worker-1") is not None
        Reaper(service.jobs, service.queue).at_start("worker-1")
    dismissed = service.submitted()

    def act(task: Any, on_progress: Any, is_wanted: Any) -> Outcome:
        service.http.delete(f"/v1/jobs/{dismissed}")
        return service.sandbox.succeed(
            task, on_progress, is_wanted
        )  # too late: it is not counted as successful

    service.sandbox.act = act
    service.worker.run(dismissed)
    found = samples(service)
    ended = {label: value for (name, label), value in found.items() if name == "cusp_jobs_ended_total"}
    assert ended == {"dismissed": 2, "job_crashed": 1}


def test_uploads_are_counted_by_format(service: Service) -> None:
    service.http.put("/v1/blobs", content=TRIANGLE_OBJ, params={"filename": "a.obj"})
    service.submitted()
    found = samples(service)
    assert found["cusp_uploads_total", "obj"] == 3
    assert found["cusp_upload_bytes_total", "obj"] == 3 * len(TRIANGLE_OBJ)


def test_counts_of_several_processes_add_up_and_outlive_them(service: Service) -> None:
    for _ in range(3):  # each as if it were a process of its own
        engine = open_database(service.settings.database)
        metrics = Metrics(engine, service.settings.data_dir)
        metrics.add({"cusp_stage_seconds": {"load": 1.5, "clean": 0.5}}, {"study": 100.0})
        metrics.add({}, {"study": 90.0})
        engine.dispose()
    found = samples(service)
    assert (found["cusp_stage_seconds_total", "load"], found["cusp_stage_seconds_total", "clean"]) == (
        4.5,
        1.5,
    )
    assert found["cusp_child_peak_mib", "study"] == 100.0


def test_a_service_that_did_nothing_tells_of_every_count(service: Service) -> None:
    told = service.http.get("/metrics").text
    assert all(
        f"# TYPE {name}_total counter" in told or f"# TYPE {name} counter" in told for name in COUNTERS
    )


def test_a_stage_is_passed_once_a_mesh_and_not_once_a_message() -> None:
    clock = StageClock()
    for stage, message in (
        *(
            ("load", "load: design"),
            ("load", "load: scan"),
            ("study", "study: 1 of 9"),
            ("study", "study: 2 of 9"),
        ),
        ("load", "load: design"),
    ):
        clock.enter(stage, message)
    clock.end()
    assert clock.passes == {"load": 3, "study": 1}
    assert set(clock.seconds) == {"load", "study"}


def test_with_keys_only_an_admin_reads_them(service: Service) -> None:
    engine = open_database(service.settings.database)
    keys = KeyStore(engine)
    for scope, status in ((Scope.READ, 403), (Scope.ADMIN, 200)):
        _, key = keys.create("acme", [scope])
        assert service.http.get("/metrics", headers={"Authorization": f"Bearer {key}"}).status_code == status
    engine.dispose()


@pytest.mark.parametrize("asked_mib", [0, 10**9])
def test_a_full_disk_is_not_ready(service: Service, asked_mib: int) -> None:
    service.jobs.worker_beat("worker-1")
    object.__setattr__(service.settings, "min_free_disk_mib", asked_mib)  # the app has the same object
    answer = service.http.get("/readyz")
    assert answer.status_code == (200 if asked_mib == 0 else 503)
    if asked_mib:
        assert "CUSP_MIN_FREE_DISK_MIB" in answer.json()["detail"]
