"""Jobs on meshes at web addresses: fetched when the job starts, guarded, limited, checked."""

import hashlib
import socket
from collections.abc import Iterator
from io import BytesIO
from typing import Any

import pytest

from service.contract.errors import MeshNotFetched
from service.settings import MIB
from service.webhooks.address_guard import Guard
from service.webhooks.mesh_fetch import MeshFetcher
from tests.support.file_server import serving_files
from tests.support.service import TRIANGLE_OBJ, Service, assert_problem

SHA256 = hashlib.sha256(TRIANGLE_OBJ).hexdigest()


@pytest.fixture
def files() -> Iterator[str]:
    with serving_files(
        {
            "/d.obj?signature=s3cret": TRIANGLE_OBJ,
            "/a": "/b",
            "/b": "/d.obj?signature=s3cret",
            "/round": "/round",
            "/inside": "http://10.0.0.7/d.obj",
            "/no": 403,
            "/picture.stl": b"\x89PNG\r\n\x1a\n" + bytes(100),
            "/large.obj": bytes(MIB + 1),
        }
    ) as address:
        yield address


def submitted(service: Service, scan: dict[str, Any], **options: Any) -> Any:
    design = service.http.put("/v1/blobs", params={"filename": "d.obj"}, content=TRIANGLE_OBJ).json()["id"]
    request = {"design": {"blob": design}, "scan": scan, "options": options}
    return service.http.post("/v1/jobs", json=request)


@pytest.mark.storages
def test_a_mesh_is_fetched_once_and_its_signature_is_forgotten(service: Service, files: str) -> None:
    answer = submitted(service, {"url": f"{files}/a", "filename": "s.obj", "sha256": SHA256})
    assert answer.status_code == 202
    assert answer.json()["inputs"]["scan"] == {"blob": None, "filename": "s.obj", "url": f"{files}/a"}
    job_id = answer.json()["id"]
    service.worker.run(job_id)
    found = service.status(job_id)
    assert (found["status"], found["inputs"]["scan"]["blob"]) == ("successful", f"sha256:{SHA256}")
    signed = submitted(service, {"url": f"{files}/d.obj?signature=s3cret"}).json()
    service.worker.run(signed["id"])
    row = service.jobs.get(signed["id"])
    assert row is not None
    assert "s3cret" not in str(row.inputs) + str(signed)
    assert row.inputs["scan"]["filename"] == "d.obj"


@pytest.mark.parametrize(
    ("scan", "code", "words"),
    [
        ({"url": "/no"}, "mesh_not_fetched", "answers 403"),
        ({"url": "/missing"}, "mesh_not_fetched", "answers 404"),
        ({"url": "/inside"}, "mesh_not_fetched", "not a public address (10.0.0.7)"),
        ({"url": "/round"}, "mesh_not_fetched", "more than 5 redirects"),
        ({"url": "/large.obj"}, "payload_too_large", "more than 1 MiB"),
        ({"url": "/b", "filename": "s.obj", "sha256": "0" * 64}, "digest_mismatch", SHA256),
        ({"url": "/picture.stl"}, "unknown_format", "scan"),
    ],
)
def test_what_cannot_be_fetched_fails_the_job_with_the_reason(
    service: Service, files: str, scan: dict[str, Any], code: str, words: str
) -> None:
    job_id = submitted(service, {**scan, "url": files + scan["url"]}).json()["id"]
    service.worker.run(job_id)
    error = service.status(job_id)["error"]
    assert error["code"] == code
    assert error["detail"].startswith("scan: ")
    assert words in error["detail"]


@pytest.mark.parametrize(
    ("url", "words"),
    [
        ("http://169.254.169.254/latest/meta-data", "not a public address"),
        ("https://user:pw@files.example.com/a.stl", "user name"),
        ("file:///etc/passwd", "must be http"),
    ],
)
def test_addresses_that_must_not_be_reached_are_refused_before_the_job_is_queued(
    service: Service, url: str, words: str
) -> None:
    answer = submitted(service, {"url": url})
    assert_problem(
        answer, 422, "invalid_request", words, "CUSP_MESH_NETWORKS" if "169" in url else "scan: url"
    )
    assert answer.json()["errors"][0]["pointer"] == "/scan/url"


def test_limits_of_a_design_that_is_fetched_hold_too(service: Service, files: str) -> None:
    blob = service.http.put("/v1/blobs", params={"filename": "d.obj"}, content=TRIANGLE_OBJ).json()["id"]
    service.http.put(f"/v1/designs/{blob}/characteristics", json={"tolerance_mm": 0.7})
    request = {"design": {"url": f"{files}/a", "filename": "d.obj"}, "scan": {"blob": blob}}
    job_id = service.http.post("/v1/jobs", json=request).json()["id"]
    service.worker.run(job_id)
    assert service.sandbox.tasks[-1]["tolerance_mm"] == 0.7


def test_a_name_that_leads_inside_is_not_reached(monkeypatch: pytest.MonkeyPatch) -> None:
    """Whatever it led to when the job was accepted: the address that the connection uses is checked."""
    inside = [(socket.AF_INET, socket.SOCK_STREAM, 6, "", ("10.0.0.7", 80))]
    monkeypatch.setattr("service.webhooks.http_client.socket.getaddrinfo", lambda *_, **__: inside)
    with pytest.raises(MeshNotFetched, match=r"a.stl .*not a public .*10.0.0.7.*CUSP_MESH_NETWORKS"):
        fetcher = MeshFetcher(Guard.of("", "CUSP_MESH_NETWORKS"), MIB, 5.0)
        fetcher.fetch("http://files.example.org/a.stl?key=1", BytesIO())


def test_the_design_of_a_batch_is_fetched_once(service: Service) -> None:
    files: dict[str, bytes | int | str] = {"/d.obj": TRIANGLE_OBJ}
    blob = service.http.put("/v1/blobs", params={"filename": "s.obj"}, content=TRIANGLE_OBJ).json()["id"]
    with serving_files(files) as address:
        scans = [{"scan": {"blob": blob, "filename": "s.obj"}}] * 2
        request = {"design": {"url": f"{address}/d.obj"}, "scans": scans}
        made = service.http.post("/v1/batches", json=request).json()
        first, second = service.waiting
        service.worker.run(first)
        files["/d.obj"] = 404
        service.worker.run(second)
    found = service.http.get(made["links"]["self"]).json()
    assert found["by_status"] == {"successful": 2}
