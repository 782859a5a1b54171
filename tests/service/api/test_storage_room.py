"""A tenant stores no more than its quota, and no upload fills the disk."""

import gzip
import shutil
import threading
from collections import namedtuple
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from service.settings import MIB
from tests.support.service import TRIANGLE_OBJ, Service, assert_problem, http_client

pytestmark = pytest.mark.storages
LARGE = TRIANGLE_OBJ + b"#" * (600 * 1024)
Usage = namedtuple("Usage", "total used free")


def limited(service: Service, **settings: Any) -> None:
    """Change settings of the running service."""
    for name, value in settings.items():
        service.settings.__dict__[name] = value


def refused(service: Service, reason: str) -> float:
    wanted = f'cusp_uploads_refused_total{{reason="{reason}"}} '
    lines = [line for line in service.http.get("/metrics").text.splitlines() if line.startswith(wanted)]
    return float(lines[0].removeprefix(wanted)) if lines else 0.0


def test_a_tenant_stores_no_more_than_its_quota(service: Service) -> None:
    limited(service, tenant_quota_mib=1)
    first = service.http.put("/v1/blobs", content=LARGE)
    assert first.status_code == 200
    for answer in (
        service.http.put("/v1/blobs", content=LARGE + b"#"),
        service.submit(scan=("s.obj", LARGE)),
    ):
        assert_problem(answer, 507, "quota_exceeded", "quota is 1")
        assert answer.headers["retry-after"] == "300"
    assert refused(service, "quota") == 2
    assert service.http.get("/v1/limits").json()["tenant_stored_mib"] == pytest.approx(0.586, abs=0.001)
    limited(service, tenant_quota_mib=0)
    assert service.http.put("/v1/blobs", content=LARGE + b"#").status_code == 200


def in_pieces(content: bytes) -> Iterator[bytes]:
    """A body without `Content-Length`."""
    for first in range(0, len(content), 50_000):
        yield content[first : first + 50_000]


def test_a_length_that_is_not_announced_counts(service: Service, monkeypatch: pytest.MonkeyPatch) -> None:
    limited(service, tenant_quota_mib=1)
    assert service.http.put("/v1/blobs", content=in_pieces(LARGE)).status_code == 200
    before = sorted(service.settings.blob_dir.rglob("*")) if service.settings.is_embedded else []
    for headers, body in (({}, LARGE + b"#"), ({"Content-Encoding": "gzip"}, gzip.compress(LARGE + b"#"))):
        answer = service.http.put("/v1/blobs", content=in_pieces(body), headers=headers)
        assert_problem(answer, 507, "quota_exceeded", "quota is 1")
    after = sorted(service.settings.blob_dir.rglob("*")) if service.settings.is_embedded else []
    assert after == before  # nothing is left of them
    limited(service, tenant_quota_mib=0)
    monkeypatch.setattr("service.api.middleware.disk_room.CHECK_BYTES", 100_000)
    usage, looks = shutil.disk_usage(service.settings.data_dir), []

    def filling(_: Path) -> Any:
        looks.append(None)
        return usage if len(looks) < 3 else usage._replace(free=0)

    monkeypatch.setattr("service.api.storage_room.shutil.disk_usage", filling)
    limited(service, min_free_disk_mib=1)
    answer = service.http.put("/v1/blobs", content=in_pieces(LARGE + b"##"))
    assert_problem(answer, 507, "storage_full", "0 MiB are free")


def test_bytes_that_arrive_at_the_same_time_count(service: Service) -> None:
    limited(service, tenant_quota_mib=1)
    first, done = threading.Event(), threading.Event()

    def slow() -> Iterator[bytes]:
        yield LARGE
        first.set()
        done.wait(30)
        yield b"#"

    answers: list[int] = []
    with http_client(str(service.http.base_url)) as other:
        sending = threading.Thread(
            target=lambda: answers.append(other.put("/v1/blobs", content=slow()).status_code)
        )
        sending.start()
        first.wait(30)
        answer = service.http.put("/v1/blobs", content=LARGE + b"##")
        while answer.status_code == 200:  # the first had not arrived yet
            answer = service.http.put("/v1/blobs", content=LARGE + b"##")
        assert_problem(answer, 507, "quota_exceeded")
        done.set()
        sending.join(30)


def test_results_count_and_a_removed_job_gives_its_room_back(service: Service) -> None:
    before = service.jobs.stored_bytes("default")
    job_id = service.finished()
    files = service.http.get(f"/v1/jobs/{job_id}/files").json()["files"]
    mesh = len(TRIANGLE_OBJ)
    assert service.jobs.stored_bytes("default") == before + mesh + sum(file["size"] for file in files)
    service.http.delete(f"/v1/jobs/{job_id}")
    assert service.jobs.stored_bytes("default") == before + mesh
    assert service.jobs.stored_bytes("another") == 0


def test_a_repeated_request_is_answered_beyond_the_quota(service: Service) -> None:
    headers = {"Idempotency-Key": "order-7"}
    ref = {"blob": service.http.put("/v1/blobs", content=LARGE).json()["id"], "filename": "a.obj"}
    body = {"design": ref, "scan": ref}
    first = service.http.post("/v1/jobs", json=body, headers=headers)
    service.http.put("/v1/blobs", content=LARGE + b"##")
    limited(service, tenant_quota_mib=1)
    assert service.http.post("/v1/jobs", json=body, headers=headers).json()["id"] == first.json()["id"]
    assert_problem(service.http.post("/v1/jobs", json=body), 507, "quota_exceeded")


def test_an_upload_that_would_fill_the_disk_is_refused(
    service: Service, monkeypatch: pytest.MonkeyPatch
) -> None:
    kept = service.settings.min_free_disk_mib * MIB
    monkeypatch.setattr(shutil, "disk_usage", lambda _: Usage(kept * 2, kept - 1, kept + len(TRIANGLE_OBJ)))
    assert service.http.put("/v1/blobs", content=TRIANGLE_OBJ).status_code == 200
    for answer in (service.http.put("/v1/blobs", content=LARGE), service.submit()):
        assert_problem(answer, 507, "storage_full", "must stay free")
        assert answer.headers["retry-after"] == "60"
    assert refused(service, "disk") == 2
