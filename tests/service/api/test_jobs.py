"""The HTTP contract, request by request."""

import json
from pathlib import Path
from typing import Any

import pytest

from service.contract.errors import JobCrashed, problem_of
from service.contract.schemas import Status
from service.execution.sandbox import Outcome
from service.jobs.store import JobStore
from tests.support.service import RESULTS, TRIANGLE_OBJ, Service, assert_problem

pytestmark = pytest.mark.storages


# --- starting


def test_a_form_starts_a_job(service: Service) -> None:
    answer = service.submit('{"label": "part 7"}')
    job = answer.json()
    assert answer.status_code == 202
    assert answer.headers["location"] == f"/v1/jobs/{job['id']}" == job["links"]["self"]
    assert answer.headers["retry-after"] == "1"
    assert (job["status"], job["label"], job["attempt"], job["stage"]) == ("accepted", "part 7", 0, None)
    assert service.waiting == [job["id"]]


def test_blobs_are_sent_once_and_used_by_json(service: Service) -> None:
    blob = service.http.put("/v1/blobs", content=TRIANGLE_OBJ, params={"filename": "d.obj"}).json()
    assert service.http.put("/v1/blobs", content=TRIANGLE_OBJ).json() == blob
    assert blob["format"] == "obj"
    assert blob["size"] == len(TRIANGLE_OBJ)
    head = service.http.head(f"/v1/blobs/{blob['id']}")
    assert (head.status_code, head.headers["x-blob-size"]) == (200, str(len(TRIANGLE_OBJ)))
    given = {"design": {"blob": blob["id"]}, "scan": {"blob": blob["id"]}, "options": {"seed": 3}}
    answer = service.http.post("/v1/jobs", json=given)
    assert answer.status_code == 202
    service.worker.run(answer.json()["id"])
    assert service.sandbox.tasks[0]["seed"] == 3


def test_options_may_come_as_a_file(service: Service) -> None:
    assert service.submit(options=("o.json", b'{"label": "from a file"}')).json()["label"] == "from a file"


POINT = '{"name": "P", "position_mm": [0, 0, 0], "radius_mm": 1, "tolerance_mm": 0.1}'


@pytest.mark.parametrize(
    ("options", "code", "words"),
    [
        (
            '{"settings": {"segmentation": {"quantil": 0.1}}}',
            "invalid_options",
            "options.settings.segmentation.quantil",
        ),
        (
            '{"settings": {"segmentation": {"quantile": 2}}}',
            "invalid_options",
            "options.settings.segmentation.quantile",
        ),
        ('{"settings": {"segmentation": 3}}', "invalid_options", "options.settings.segmentation"),
        ('{"sede": 1}', "invalid_options", "options.sede: unknown key"),
        ('{"seed": -1}', "invalid_options", "options.seed"),
        ('{"tolerance_mm": 0}', "invalid_options", "options.tolerance_mm"),
        ('{"tolerance_mm": NaN}', "invalid_options", "options.tolerance_mm"),
        ('{"acceptance": {"tolerance_mm": 1, "upper_mm": 2}}', "invalid_options", "not both"),
        ('{"alignment": {"kind": "tolerance_fit"}}', "invalid_options", "needs limits"),
        (
            '{"alignment": {"kind": "rps", "points": [{"name": "A", "position_mm": [0, 0, 0], '
            '"direction": [0, 0, 1], "radius_mm": 1}]}}',
            "invalid_options",
            "the points leave a motion free: the rotation about",
        ),
        ('{"acceptance": {"min_within": 0.9}}', "invalid_options", "acceptance: min_within"),
        ('{"acceptance": {"lower_mm": 0.2, "upper_mm": 0.1}}', "invalid_options", "must be below upper_mm"),
        (
            '{"acceptance": {"points": [' + POINT + ", " + POINT + "]}}",
            "invalid_options",
            "'P' is given twice",
        ),
        (
            '{"acceptance": {"points": [' + POINT.replace("0.1", "-0.1") + "]}}",
            "invalid_options",
            "options.acceptance.points.0.tolerance_mm",
        ),
        (
            '{"acceptance": {"points": [' + POINT + '], "distances": [{"name": "d", "first": "P", '
            '"second": "Q", "upper_mm": 1}]}}',
            "invalid_options",
            "'Q' is none of `points`",
        ),
        (
            '{"acceptance": {"regions": [{"name": "a", "region": {"kind": "named", "name": "seat"}, '
            '"upper_mm": 1}]}}',
            "invalid_options",
            "no region is named 'seat'",
        ),
        (
            '{"acceptance": {"regions": [{"name": "a", "region": {"kind": "brep_faces", "faces": [3]}, '
            '"upper_mm": 1}]}}',
            "invalid_options",
            "options.acceptance.regions.0.region.faces: the file of the design has only triangles",
        ),
        ('{"reference": {"serial": ""}}', "invalid_options", "options.reference.serial"),
        ('{"reference": {"more": {"1": "x"}}}', "invalid_options", "options.reference.more"),
        ('{"scan_accuracy_mm": 0}', "invalid_options", "options.scan_accuracy_mm"),
        ('{"scan_accuracy_mm": -0.1}', "invalid_options", "options.scan_accuracy_mm"),
        ('{"scan_accuracy_mm": Infinity}', "invalid_options", "options.scan_accuracy_mm"),
        ('{"units": {"scan": "ell"}}', "invalid_options", "options.units.scan"),
        ('{"preset": "best"}', "invalid_options", "options.preset"),
        ('{"webhook": {"url": "http://10.0.0.1"}}', "invalid_options", "options.webhook.url"),
        ('{"webhook": "http://example.org"}', "invalid_options", "options.webhook"),
        ("[]", "invalid_options", "object"),
    ],
)
def test_a_wrong_option_is_named(service: Service, options: str, code: str, words: str) -> None:
    assert_problem(service.submit(options), 422, code, words)
    assert service.waiting == []


def test_options_that_are_not_json_are_a_bad_request(service: Service) -> None:
    assert_problem(service.submit("{label: x}"), 400, "bad_request", "options", "JSON")


def test_settings_go_over_the_preset(service: Service) -> None:
    service.finished('{"preset": "paper", "settings": {"segmentation": {"quantile": 0.03}}}')
    told = service.sandbox.tasks[0]["settings"]
    assert told["segmentation"]["quantile"] == 0.03
    assert told["segmentation"]["density"] == "vertex"
    assert told["resample"]["enabled"] is False


@pytest.mark.parametrize(
    ("files", "words"),
    [
        ({"design": ("d.obj", TRIANGLE_OBJ)}, "scan: missing; send it as a file of the form"),
        ({"design": ("d.obj", TRIANGLE_OBJ), "scan": (None, "text")}, "scan: must be a file"),
        (
            {"design": ("d.obj", TRIANGLE_OBJ), "scan": ("s.obj", TRIANGLE_OBJ), "source": ("x", b"y")},
            "source: unknown",
        ),
    ],
)
def test_a_wrong_part_is_named(service: Service, files: Any, words: str) -> None:
    assert_problem(service.http.post("/v1/jobs", files=files), 422, "invalid_request", words)


def test_unknown_blobs_and_fields_are_named(service: Service) -> None:
    blob = "sha256:" + "0" * 64
    given = {"design": {"blob": blob}, "scan": {"blob": blob}}
    assert_problem(service.http.post("/v1/jobs", json=given), 422, "unknown_blob", "design", blob)
    assert_problem(
        service.http.post("/v1/jobs", json={**given, "more": 1}), 422, "invalid_request", "more: unknown key"
    )
    assert_problem(
        service.http.post("/v1/jobs", json={"design": {"blob": "x"}}), 422, "invalid_request", "design.blob"
    )
    assert_problem(service.http.post("/v1/jobs", json=[1]), 422, "invalid_request", "object")
    not_json = service.http.post("/v1/jobs", content=b"{", headers={"content-type": "application/json"})
    assert_problem(not_json, 400, "bad_request", "JSON")
    assert_problem(
        service.http.post("/v1/jobs", content=b"x"), 415, "unsupported_media_type", "multipart/form-data"
    )
    assert service.http.head(f"/v1/blobs/{blob}").status_code == 404


def test_a_full_queue_says_when_to_come_back(service: Service) -> None:
    for _ in range(service.settings.queue_limit):
        service.submitted()
    answer = service.submit()
    assert_problem(answer, 503, "queue_full")
    assert int(answer.headers["retry-after"]) > 0


# --- watching


@pytest.mark.parametrize("address", ["results", "files/aligned.ply"])
def test_a_file_that_the_client_has_is_not_sent_again(service: Service, address: str) -> None:
    url = f"/v1/jobs/{service.finished()}/{address}"
    first = service.http.get(url)
    again = service.http.get(url, headers={"If-None-Match": f'"other", {first.headers["ETag"]}'})
    assert (again.status_code, again.content, again.headers["ETag"]) == (304, b"", first.headers["ETag"])
    assert service.http.get(url, headers={"If-None-Match": '"other"'}).content == first.content


def test_status_has_an_etag_and_answers_304(service: Service) -> None:
    job_id = service.submitted()
    first = service.http.get(f"/v1/jobs/{job_id}")
    assert first.headers["retry-after"] == "1"
    again = service.http.get(f"/v1/jobs/{job_id}", headers={"If-None-Match": first.headers["etag"]})
    assert (again.status_code, again.content) == (304, b"")
    service.worker.run(job_id)
    final = service.http.get(f"/v1/jobs/{job_id}", headers={"If-None-Match": first.headers["etag"]})
    assert final.json()["status"] == "successful"
    assert final.json()["progress"] == 100
    assert "retry-after" not in final.headers


def test_prefer_wait_answers_at_once_when_final(service: Service) -> None:
    answer = service.http.get(f"/v1/jobs/{service.finished()}", headers={"Prefer": "respond-async, wait=30"})
    assert answer.json()["status"] == "successful"
    assert answer.headers["preference-applied"] == "wait=30"


def test_a_listing_is_paged_and_filtered(service: Service) -> None:
    ids = [service.submitted(json.dumps({"label": f"part {number % 2}"})) for number in range(5)]
    service.worker.run(ids[0])
    assert ids == sorted(ids)
    seen: list[str] = []
    cursor: str | None = None
    while True:
        page = service.http.get(
            "/v1/jobs", params={"limit": 2} | ({"cursor": cursor} if cursor else {})
        ).json()
        seen += [job["id"] for job in page["jobs"]]
        cursor = page["next"]
        if cursor is None:
            break
    assert seen == ids[::-1]

    def listed(**query: str) -> list[str]:
        return [job["id"] for job in service.http.get("/v1/jobs", params=query).json()["jobs"]]

    assert listed(status="successful") == [ids[0]]
    assert listed(label="part 1") == [ids[3], ids[1]]
    assert listed(type="study") == []
    assert_problem(service.http.get("/v1/jobs?status=done"), 422, "invalid_request", "status")
    assert_problem(service.http.get("/v1/jobs?limit=0"), 422, "invalid_request", "limit")


RESULTS_OF_A_PART = (
    b'{"schema_version": "1", "verdict": {"status": "ok"}, "inspection": {"decision": "%s"}, '
    b'"deviation": {"within": 0.957}}'
)


def test_jobs_are_found_by_the_part_and_what_became_of_it(service: Service) -> None:
    def judged(decision: bytes) -> Any:
        def act(task: dict[str, Any], on_progress: Any, is_wanted: Any) -> Any:
            outcome = service.sandbox.succeed(task, on_progress, is_wanted)
            (Path(task["out"]) / "results.json").write_bytes(RESULTS_OF_A_PART % decision)
            return outcome

        return act

    ids = []
    for number, decision in enumerate((b"pass", b"fail", b"pass")):
        service.sandbox.act = judged(decision)
        reference = {"serial": f"A-{number}", "batch": "B1", "more": {"shift": "2"}}
        scan = (f"Größe {number}.obj", TRIANGLE_OBJ)
        answer = service.submit(json.dumps({"label": f"lid {number}", "reference": reference}), scan=scan)
        ids.append(answer.json()["id"])
        service.worker.run(ids[-1])

    def listed(**query: str) -> list[str]:
        return [job["id"] for job in service.http.get("/v1/jobs", params=query).json()["jobs"]]

    assert listed(decision="fail") == [ids[1]]
    assert listed(decision="pass", serial="A-2") == [ids[2]]
    assert listed(verdict="ok", batch="B1") == ids[::-1]
    assert listed(verdict="mirrored") == listed(part_number="B1") == []
    assert listed(label="~id 1") == [ids[1]]
    assert listed(label="~%") == []
    assert listed(name="ID 1") == listed(name="a-1") == listed(name="größe 1") == [ids[1]]
    assert listed(name="b1", decision="pass") == [ids[2], ids[0]]
    assert listed(name="%") == listed(name="shift") == []
    job = service.status(ids[1])
    assert (job["verdict"], job["decision"], job["reference"]["serial"]) == ("ok", "fail", "A-1")
    assert job["reference"]["more"] == {"shift": "2"}
    assert job["within"] == 0.957
    service.http.delete(f"/v1/jobs/{ids[2]}")
    assert listed(name="lid 2") == []
    assert 'cusp_decisions_total{decision="pass"} 2.0' in service.http.get("/metrics").text
    assert_problem(service.http.get("/v1/jobs?decision=maybe"), 422, "invalid_request", "decision")


@pytest.mark.parametrize(
    "content", [b"no json", b"[]", b'{"verdict": 3}', b'{"verdict": {"status": "a b"}, "inspection": []}']
)
def test_odd_results_have_no_verdict(service: Service, content: bytes) -> None:
    def act(task: dict[str, Any], on_progress: Any, is_wanted: Any) -> Any:
        outcome = service.sandbox.succeed(task, on_progress, is_wanted)
        (Path(task["out"]) / "results.json").write_bytes(content)
        return outcome

    service.sandbox.act = act
    job = service.status(service.finished())
    assert (job["status"], job["verdict"], job["decision"]) == ("successful", None, None)


# --- fetching


def test_results_and_files_of_a_successful_job(service: Service) -> None:
    job_id = service.finished()
    assert service.http.get(f"/v1/jobs/{job_id}/results").content == RESULTS
    files = service.http.get(f"/v1/jobs/{job_id}/files").json()["files"]
    assert [file["name"] for file in files] == ["results.json", "aligned.ply"]
    for file in files:
        answer = service.http.get(file["href"])
        assert len(answer.content) == file["size"] == int(answer.headers["content-length"])
    assert_problem(service.http.get(f"/v1/jobs/{job_id}/files/child.log"), 404, "file_not_found", "child.log")
    assert_problem(service.http.get(f"/v1/jobs/{job_id}/files/..%2f..%2fcusp.db"), 404, "not_found")


def test_results_before_the_end_are_a_conflict(service: Service) -> None:
    job_id = service.submitted()
    for path in ("results", "files", "files/results.json"):
        assert_problem(service.http.get(f"/v1/jobs/{job_id}/{path}"), 409, "job_not_final", "accepted")


def test_results_of_a_failed_job_are_its_problem(service: Service) -> None:
    service.sandbox.act = lambda *_: Outcome("failed", problem_of(JobCrashed("killed by SIGSEGV")), 0.1, None)
    job_id = service.finished()
    status = service.status(job_id)
    assert status["status"] == "failed"
    assert status["error"]["code"] == "job_crashed"
    assert_problem(service.http.get(f"/v1/jobs/{job_id}/results"), 500, "job_crashed", "SIGSEGV")
    files = service.http.get(f"/v1/jobs/{job_id}/files")
    assert_problem(files, 409, "job_not_final", "failed")
    assert "retry-after" not in files.headers  # a client that waits for them would wait for ever


# --- dismissing


def test_a_queued_job_is_dropped(service: Service) -> None:
    job_id = service.submitted()
    assert service.http.delete(f"/v1/jobs/{job_id}").status_code == 204
    assert service.waiting == []
    assert service.status(job_id)["status"] == "dismissed"
    assert_problem(service.http.get(f"/v1/jobs/{job_id}/results"), 409, "job_dismissed")
    service.worker.run(job_id)  # a ticket that was out already is void
    assert service.sandbox.tasks == []


def test_a_running_job_is_no_longer_wanted(service: Service) -> None:
    def act(task: Any, on_progress: Any, is_wanted: Any) -> Outcome:
        assert is_wanted()
        assert service.http.delete(f"/v1/jobs/{job_id}").status_code == 204
        assert not is_wanted()
        return Outcome("unwanted", None, 0.1, None)

    service.sandbox.act = act
    job_id = service.submitted()
    service.worker.run(job_id)
    assert service.status(job_id)["status"] == "dismissed"


def test_a_final_job_is_removed_with_its_results(service: Service) -> None:
    job_id = service.finished()
    for _ in range(2):
        assert service.http.delete(f"/v1/jobs/{job_id}").status_code == 204
    assert_problem(service.http.get(f"/v1/jobs/{job_id}"), 404, "job_not_found")
    assert service.http.get("/v1/jobs").json()["jobs"] == []
    assert not list(service.settings.blob_dir.glob(f"results/{job_id}/*/*"))
    assert_problem(service.http.delete("/v1/jobs/unknown"), 404, "job_not_found")


# --- the service itself


def test_readiness_needs_a_living_worker(service: Service) -> None:
    assert service.http.get("/livez").json() == {"status": "ok"}
    assert_problem(service.http.get("/readyz"), 503, "not_ready", "worker")
    service.jobs.worker_beat("worker-1")
    assert service.http.get("/readyz").json() == {"status": "ok"}


def test_version_limits_and_documentation(service: Service) -> None:
    assert service.http.get("/version").json()["name"] == "cusp"
    assert service.http.get("/v1/limits").json()["job_types"] == ["registration", "landmarks", "study"]
    assert service.http.get("/openapi.json").json()["info"]["title"] == "Cusp"
    assert service.http.get("/docs").status_code == 200
    assert "<title>Cusp" in service.http.get("/").text


def test_unknown_addresses_and_methods_are_problems(service: Service) -> None:
    assert_problem(service.http.get("/v2/jobs"), 404, "not_found", "/v2/jobs")
    answer = service.http.put("/v1/jobs")
    assert_problem(answer, 405, "method_not_allowed", "PUT")
    assert "POST" in answer.headers["allow"]


def test_a_mistake_of_ours_is_a_500_with_an_id_and_no_stack(service: Service, monkeypatch: Any) -> None:
    def fail(*_: object, **__: object) -> None:
        raise ZeroDivisionError("secret of the implementation")

    monkeypatch.setattr("service.jobs.store.JobStore.page", fail)
    answer = service.http.get("/v1/jobs")
    assert_problem(answer, 500, "internal_error")
    assert answer.json()["instance"] in answer.json()["detail"]
    assert "secret" not in answer.text
    assert service.http.get("/livez").status_code == 200


def test_nothing_of_a_refused_upload_is_kept(service: Service) -> None:
    assert service.submit(scan=("s.obj", b"")).status_code == 422
    assert [path for path in service.settings.blob_dir.rglob("*") if path.is_file()] == []
    assert service.jobs.count(Status.ACCEPTED) == 0


# --- cancelling


def test_cancel_ends_a_job_and_never_its_results(service: Service) -> None:
    """Also when it comes too late, or between the look at the status and the change."""
    waiting, done = service.submitted(), service.finished()
    cancelled = service.http.post(f"/v1/jobs/{waiting}/cancel")
    assert (cancelled.status_code, cancelled.json()["status"]) == (200, "dismissed")
    assert service.http.post(f"/v1/jobs/{waiting}/cancel").json() == cancelled.json()  # a repeated request
    assert service.waiting == []
    assert_problem(
        service.http.post(f"/v1/jobs/{done}/cancel"), 409, "job_final", "successful", "nothing to cancel"
    )
    assert service.http.get(f"/v1/jobs/{done}/results").content == RESULTS
    assert_problem(service.http.post("/v1/jobs/unknown/cancel"), 404, "job_not_found")


def test_a_cancel_that_meets_the_end_of_the_job_loses_nothing(
    service: Service, monkeypatch: pytest.MonkeyPatch
) -> None:
    job_id, dismiss = service.submitted(), JobStore.dismiss

    def late(jobs: JobStore, *given: Any) -> bool:
        monkeypatch.setattr(JobStore, "dismiss", dismiss)
        service.worker.run(job_id)
        return dismiss(jobs, *given)

    monkeypatch.setattr(JobStore, "dismiss", late)
    assert_problem(service.http.post(f"/v1/jobs/{job_id}/cancel"), 409, "job_final")
    assert service.http.get(f"/v1/jobs/{job_id}/results").content == RESULTS


def test_delete_cancels_only_if_it_is_told_so(service: Service) -> None:
    job_id = service.submitted()
    address = f"/v1/jobs/{job_id}"
    assert_problem(service.http.delete(address, params={"cancel": "false"}), 409, "job_not_final", "accepted")
    assert service.status(job_id)["status"] == "accepted"
    told = service.http.delete(address, params={"cancel": "true"})
    assert told.status_code == 204 and "deprecation" not in told.headers
    assert service.status(job_id)["status"] == "dismissed"
    # Without a word, for one version more, and said so; a final job is removed as ever.
    silent = service.http.delete(f"/v1/jobs/{service.submitted()}")
    assert silent.status_code == 204 and silent.headers["deprecation"].startswith("@")
    removed = service.http.delete(f"/v1/jobs/{service.finished()}")
    assert removed.status_code == 204 and "deprecation" not in removed.headers


def test_a_job_tells_its_place_and_what_is_left(service: Service) -> None:
    done, first, second = service.finished(), service.submitted(), service.submitted()

    def forecast(job_id: str) -> dict[str, Any]:
        found: dict[str, Any] = service.http.get(f"/v1/jobs/{job_id}/forecast").json()
        return found

    assert [forecast(each)["place"] for each in (done, first, second)] == [None, 1, 2]
    assert (forecast(done)["remaining_s"], forecast(second)["remaining_s"]) == (0.0, None)
    assert forecast(second)["based_on"] == 1  # too few for an estimate
    for job_id in (first, second):
        service.worker.run(job_id)
    assert forecast(service.submitted())["remaining_s"] is not None
    assert_problem(service.http.get("/v1/jobs/none/forecast"), 404, "job_not_found")


def test_a_job_tells_what_was_asked_of_it(service: Service) -> None:
    asked = {"tolerance_mm": 0.2, "acceptance": {"min_within": 0.9}, "label": "part 7"}
    webhook = {"webhook": {"url": "http://93.184.216.34/hook?token=secret"}}
    job_id = service.submitted(json.dumps(asked | webhook))
    answer = service.http.get(f"/v1/jobs/{job_id}/options")
    told = answer.json()
    assert (told["tolerance_mm"], told["label"], told["acceptance"]["min_within"]) == (0.2, "part 7", 0.9)
    assert told["webhook"] == {"url": "http://93.184.216.34/hook"} and "secret" not in answer.text
    again = service.submitted(json.dumps({key: value for key, value in told.items() if key != "webhook"}))
    assert service.http.get(f"/v1/jobs/{again}/options").json() == told | {"webhook": None}
    assert_problem(service.http.get("/v1/jobs/none/options"), 404, "job_not_found")
