"""Many scans of one design: one id, one status, one message, one table; cancelled and tried again."""

import csv
import io
import json
from pathlib import Path
from typing import Any

import pytest

from service.contract.errors import JobCrashed, problem_of
from service.execution.sandbox import Outcome
from service.storage.database import open_database
from service.webhooks.outbox import Deliveries
from tests.support.service import TRIANGLE_OBJ, Service, assert_problem

pytestmark = pytest.mark.storages

RESULTS = {"ok": ("ok", "pass"), "bad": ("ok", "fail"), "odd": ("uncertain", "not_judged")}


@pytest.fixture
def blob(service: Service) -> str:
    return str(service.http.put("/v1/blobs", params={"filename": "d.obj"}, content=TRIANGLE_OBJ).json()["id"])


def batch(service: Service, blob: str, *labels: str, key: str | None = None, **given: Any) -> Any:
    scans = [
        {"scan": {"blob": blob, "filename": "s.obj"}, "label": label, "reference": {"serial": f"A-{number}"}}
        for number, label in enumerate(labels)
    ]
    request = {"design": {"blob": blob, "filename": "d.obj"}, "scans": scans, **given}
    return service.http.post(
        "/v1/batches", json=request, headers={} if key is None else {"Idempotency-Key": key}
    )


def act_by_label(service: Service) -> None:
    """Each job ends as its serial number and label say."""

    def act(task: dict[str, Any], on_progress: Any, is_wanted: Any) -> Outcome:
        label = labels[task["reference"]["serial"]]
        if label == "crash":
            return Outcome("failed", problem_of(JobCrashed("out of luck")), 0.1, None)
        outcome = service.sandbox.succeed(task, on_progress, is_wanted)
        status, decision = RESULTS[label]
        document = {
            "type": "registration",
            "verdict": {"status": status},
            "inspection": {"decision": decision},
        }

        (Path(task["out"]) / "results.json").write_text(json.dumps(document))
        return outcome

    labels = {"A-0": "ok", "A-1": "bad", "A-2": "crash", "A-3": "odd"}
    service.sandbox.act = act


def run_all(service: Service) -> None:
    for job_id in list(service.waiting):
        service.worker.run(job_id)


def test_a_batch_from_its_request_to_its_message_and_table(service: Service, blob: str) -> None:
    act_by_label(service)
    shared = {"reference": {"batch": "2026-11", "serial": "none"}, "tolerance_mm": 0.2}
    answer = batch(
        *(service, blob, "ok", "bad", "crash", "odd"),
        options=shared,
        label="night",
        webhook={"url": "https://mes.example.com/hook"},
    )
    assert answer.status_code == 202, answer.text
    made = answer.json()
    address = answer.headers["Location"]
    assert (made["status"], made["total"], made["by_status"]) == ("accepted", 4, {"accepted": 4})
    first, *others = service.waiting
    service.worker.run(first)
    assert service.http.get(address).json()["status"] == "running"
    for job_id in others:
        service.worker.run(job_id)
    found = service.http.get(address).json()
    assert (found["status"], found["by_status"]) == ("finished", {"failed": 1, "successful": 3})
    assert found["by_verdict"] == {"ok": 2, "uncertain": 1}
    assert found["by_decision"] == {"pass": 1, "fail": 1, "not_judged": 1}
    (message,) = service.http.get(f"{address}/deliveries").json()["deliveries"]
    assert (message["event"], message["job"]) == ("batch.finished", made["id"])
    (row,) = Deliveries(open_database(service.settings.database)).of_job(made["id"])
    assert json.loads(row.body)["data"]["by_decision"] == found["by_decision"]
    table = list(csv.DictReader(io.StringIO(service.http.get(f"{address}/table.csv").text)))
    assert [line["serial"] for line in table] == ["A-0", "A-1", "A-2", "A-3"]
    assert {line["batch"] for line in table} == {"2026-11"}
    assert [line["decision"] for line in table] == ["pass", "fail", "", "not_judged"]
    assert table[2]["error"] == "job_crashed"
    jobs = service.http.get(f"/v1/jobs?batch_id={made['id']}&decision=fail").json()["jobs"]
    assert [(job["label"], job["batch_id"]) for job in jobs] == [("bad", made["id"])]
    listed = service.http.get("/v1/batches?label=night").json()
    assert ([each["id"] for each in listed["batches"]], listed["next"]) == ([made["id"]], None)

    failed = table[2]["job"]
    again = service.http.post(f"{address}/retry").json()
    assert (again["status"], again["by_status"]) == ("running", {"accepted": 1, "successful": 3})
    service.sandbox.act = service.sandbox.succeed
    run_all(service)
    assert service.http.get(address).json()["status"] == "finished"
    assert len(service.http.get(f"{address}/deliveries").json()["deliveries"]) == 2
    assert service.status(failed)["batch_id"] is None
    assert service.http.post(f"{address}/retry").json()["by_status"] == {"successful": 4}


def test_a_cancelled_batch_ends_and_keeps_its_results(service: Service, blob: str) -> None:
    address = batch(service, blob, "a", "b", "c").headers["Location"]
    service.worker.run(service.waiting[0])
    found = service.http.post(f"{address}/cancel").json()
    assert (found["status"], found["by_status"]) == ("finished", {"dismissed": 2, "successful": 1})
    assert service.http.post(f"{address}/cancel").json()["status"] == "finished"


def test_the_same_request_is_the_same_batch(service: Service, blob: str) -> None:
    first, second = (batch(service, blob, "a", key="order-7").json()["id"] for _ in range(2))
    assert first == second
    assert_problem(batch(service, blob, "b", key="order-7"), 422, "idempotency_mismatch")
    assert len(service.waiting) == 1


@pytest.mark.parametrize(
    ("changed", "code", "words"),
    [
        ({"scans": []}, "invalid_request", "scans"),
        ({"scans": [{"scan": {"blob": f"sha256:{'0' * 64}"}}]}, "unknown_blob", "scans/0/scan"),
        ({"scans": [{"scan": {"url": "http://10.0.0.7/a"}}]}, "invalid_request", "scans/0/scan: url"),
        ({"options": {"webhook": {"url": "https://x.example.com"}}}, "invalid_request", "one message"),
        ({"options": {"tolerance_mm": -1}}, "invalid_options", "options.tolerance_mm"),
        ({"webhook": {"url": "http://10.0.0.7/a"}}, "invalid_options", "webhook.url"),
        ({"scans": [{"scan": {"blob": "x"}}] * 6}, "invalid_request", "blob"),
    ],
)
def test_a_wrong_batch_is_refused_as_a_whole(
    service: Service, blob: str, changed: dict[str, Any], code: str, words: str
) -> None:
    assert_problem(batch(service, blob, "a", **changed), 422, code, words)
    assert service.waiting == []


def test_a_batch_beyond_the_queue_limit_is_refused_as_a_whole(service: Service, blob: str) -> None:
    assert_problem(batch(service, blob, *"abcdef"), 503, "queue_full")
    assert_problem(service.http.get("/v1/batches/7"), 404, "batch_not_found")
    assert service.waiting == []
