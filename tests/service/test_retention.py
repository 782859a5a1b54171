"""After its time a job and its files are gone, and a mesh that nobody needs; never what is needed."""

import hashlib
import os
import time
from pathlib import Path

import obstore
import pytest

from service.job_store import JobStore
from service.jobs import now_ms
from service.keys import KeyStore, Scope
from service.retention import HOUR_MS, Retention
from service.store import open_database
from tests.service.conftest import TRIANGLE_OBJ, Service

pytestmark = pytest.mark.storages

BLOB = "sha256:" + hashlib.sha256(TRIANGLE_OBJ).hexdigest()


def sweep(service: Service, hours_later: float, *, hours: float = 24) -> None:
    """As if so much time had gone by; the files' own times follow."""
    for path in Path(service.settings.blob_dir).rglob("*"):
        if path.is_file():
            then = min(path.stat().st_mtime, time.time() - 3600 * hours_later)
            os.utime(path, (then, then))
    real = now_ms()
    engine = open_database(service.settings.database)
    later = JobStore(engine, lambda: real + int(hours_later * HOUR_MS))
    Retention(later, service.blobs, hours, lambda: real + int(hours_later * HOUR_MS)).sweep()
    engine.dispose()


def kept_files(service: Service) -> list[str]:
    return sorted(entry["path"] for batch in obstore.list(service.blobs.store) for entry in batch)


def test_a_job_goes_with_its_files_and_meshes_after_its_time(service: Service) -> None:
    job_id = service.finished()
    sweep(service, 23)
    assert service.status(job_id)["status"] == "successful"
    assert len(kept_files(service)) == 3
    sweep(service, 25)
    assert service.http.get(f"/v1/jobs/{job_id}").status_code == 404
    assert kept_files(service) == []
    assert service.http.head(f"/v1/blobs/{BLOB}").status_code == 404
    assert service.http.delete(f"/v1/jobs/{job_id}").status_code == 204  # its id is still known
    sweep(service, 51)
    assert service.http.delete(f"/v1/jobs/{job_id}").status_code == 404


def test_what_an_unfinished_job_needs_stays(service: Service) -> None:
    job_id = service.submitted()
    sweep(service, 1000)
    assert service.status(job_id)["status"] == "accepted"
    service.worker.run(job_id)
    assert service.status(job_id)["status"] == "successful"


def test_a_mesh_that_a_new_job_names_is_new(service: Service, monkeypatch: pytest.MonkeyPatch) -> None:
    service.http.put("/v1/blobs", content=TRIANGLE_OBJ, params={"filename": "a.obj"})
    real = now_ms()
    monkeypatch.setattr(service.jobs, "_clock_ms", lambda: real + 20 * HOUR_MS)
    assert service.jobs.touch_blob(BLOB, "default")
    sweep(service, 25)
    assert service.http.head(f"/v1/blobs/{BLOB}").status_code == 200
    assert not service.jobs.touch_blob(BLOB, "other")


def test_content_stays_while_another_tenant_has_it(service: Service) -> None:
    service.http.put("/v1/blobs", content=TRIANGLE_OBJ, params={"filename": "a.obj"})
    engine = open_database(service.settings.database)
    _, key = KeyStore(engine).create("acme", [Scope.WRITE, Scope.READ])
    engine.dispose()
    service.jobs.add_blob(BLOB, len(TRIANGLE_OBJ), "obj", "acme")
    for row in service.jobs.blobs_before(now_ms() + HOUR_MS, 10):
        if row.tenant == "default":
            assert service.jobs.forget_blob(row, now_ms() + HOUR_MS)
    service.blobs.remove(BLOB, older_than_ms=0)  # too young: nothing
    headers = {"Authorization": f"Bearer {key}"}
    assert service.http.head(f"/v1/blobs/{BLOB}", headers=headers).status_code == 200
    assert service.jobs.has_blob(BLOB)


def test_nothing_goes_where_everything_is_kept(service: Service) -> None:
    job_id = service.finished()
    sweep(service, 1e6, hours=0)
    assert service.status(job_id)["status"] == "successful"
    assert len(kept_files(service)) == 3
