"""A request sent twice is one job: also at the same moment, also by another way of sending the same
meshes.
"""

from concurrent.futures import ThreadPoolExecutor

import httpx
import pytest

from service.auth.keys import KeyStore, Scope
from service.contract.schemas import Options
from service.storage.database import open_database
from tests.support.service import TRIANGLE_OBJ, Service

pytestmark = pytest.mark.storages

MESHES = {"design": ("d.obj", TRIANGLE_OBJ), "scan": ("s.obj", TRIANGLE_OBJ)}


def post(service: Service, key: str, options: str = "{}", **changed: tuple[str, bytes]) -> httpx.Response:
    files = MESHES | changed
    return service.http.post(
        "/v1/jobs", files=files, data={"options": options}, headers={"Idempotency-Key": key}
    )


def test_the_same_request_is_the_same_job(service: Service) -> None:
    first, again = post(service, "order-7"), post(service, "order-7")
    assert first.status_code == again.status_code == 202
    assert first.json()["id"] == again.json()["id"]
    assert again.headers["Location"] == first.headers["Location"]
    assert service.waiting == [first.json()["id"]]
    service.worker.run(first.json()["id"])
    assert post(service, "order-7").json()["status"] == "successful"


def test_meshes_sent_before_as_blobs_are_the_same_meshes(service: Service) -> None:
    first = post(service, "order-7").json()["id"]
    blob = service.http.put("/v1/blobs", content=TRIANGLE_OBJ, params={"filename": "a.obj"}).json()["id"]
    ref = {"blob": blob, "filename": "renamed.obj"}
    again = service.http.post(
        "/v1/jobs", json={"design": ref, "scan": ref}, headers={"Idempotency-Key": "order-7"}
    )
    assert again.json()["id"] == first


def test_another_request_under_the_key_is_refused(service: Service) -> None:
    first = post(service, "order-7").json()["id"]
    other_mesh = ("s.obj", TRIANGLE_OBJ + b"v 2 0 0\n")
    for answer in (
        post(service, "order-7", '{"seed": 1}'),
        post(service, "order-7", '{"scan_accuracy_mm": 0.05}'),
        post(service, "order-7", scan=other_mesh),
    ):
        assert (answer.status_code, answer.json()["code"]) == (422, "idempotency_mismatch")
        assert "order-7" in answer.json()["detail"]
    assert post(service, "order-8", '{"seed": 1}').json()["id"] != first
    assert len(service.waiting) == 2


def test_of_requests_at_the_same_moment_one_starts_the_job(service: Service) -> None:
    with ThreadPoolExecutor(8) as pool:
        answers = list(pool.map(lambda _: post(service, "order-7"), range(16)))
    assert {answer.status_code for answer in answers} == {202}
    assert len({answer.json()["id"] for answer in answers}) == 1
    assert len(service.waiting) == 1
    assert len(service.http.get("/v1/jobs").json()["jobs"]) == 1


def test_a_key_whose_job_was_removed_starts_anew(service: Service) -> None:
    first = post(service, "order-7").json()["id"]
    service.worker.run(first)
    service.http.delete(f"/v1/jobs/{first}")
    second = post(service, "order-7").json()
    assert second["id"] != first
    assert second["status"] == "accepted"
    assert post(service, "order-7").json()["id"] == second["id"]


def test_keys_are_a_tenants_own(service: Service) -> None:
    engine = open_database(service.settings.database)
    keys = KeyStore(engine)
    ids = set()
    for tenant in ("acme", "other"):
        _, key = keys.create(tenant, [Scope.WRITE])
        service.http.headers["Authorization"] = f"Bearer {key}"
        ids.add(post(service, "order-7").json()["id"])
    engine.dispose()
    assert len(ids) == 2


@pytest.mark.parametrize("key", ["", "a b", "x" * 256])
def test_a_key_that_is_none_is_refused(service: Service, key: str) -> None:
    answer = post(service, key)
    assert (answer.status_code, answer.json()["code"]) == (422, "invalid_request")
    assert service.waiting == []


def test_a_request_that_is_sent_again_is_answered_though_the_queue_is_full(service: Service) -> None:
    first = [post(service, f"order-{number}").json()["id"] for number in range(service.settings.queue_limit)]
    blob = service.http.put("/v1/blobs", content=TRIANGLE_OBJ, params={"filename": "a.obj"}).json()["id"]
    ref = {"blob": blob, "filename": "a.obj"}
    assert post(service, "order-0").json()["id"] == first[0]
    again = service.http.post(
        "/v1/jobs", json={"design": ref, "scan": ref}, headers={"Idempotency-Key": "order-1"}
    )
    assert again.json()["id"] == first[1]
    for key, status, code in (("order-new", 503, "queue_full"), ("order-0", 422, "idempotency_mismatch")):
        answer = post(service, key, '{"seed": 5}')
        assert (answer.status_code, answer.json()["code"]) == (status, code)
    service.worker.run(first[0])
    service.http.delete(f"/v1/jobs/{first[0]}")
    post(service, "order-7")
    assert (
        post(service, "order-0").json()["code"] == "queue_full"
    )  # its job is gone: this would start another


def test_a_retry_after_an_upgrade_is_the_same_request(
    service: Service, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The hash is of what the client sent: a new default, or a new option, is none of its doing."""
    first = post(service, "order-7", '{"label": "x", "settings": {"resample": {"target_vertices": 900}}}')

    class LaterOptions(Options):
        seed: int = 5
        of_a_later_version: bool = True

    monkeypatch.setattr("service.contract.options.Options", LaterOptions)
    again = post(service, "order-7", '{"settings":{"resample":{"target_vertices":900}},"label":"x"}')
    assert again.status_code == 202, again.text
    assert again.json()["id"] == first.json()["id"]
    assert post(service, "order-7", '{"label": "y"}').status_code == 422
