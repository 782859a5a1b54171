"""After its time a job and its files are gone, and a mesh that nobody needs; never what is needed."""

import hashlib
import io

import obstore
import pytest
from obstore.exceptions import GenericError

from service.auth.keys import KeyStore, Scope
from service.jobs.models import new_id, now_ms
from service.jobs.retention import HOUR_MS, Retention
from service.jobs.store import JobStore
from service.storage.database import open_database
from service.storage.design_cache import DesignCache
from tests.support.service import TRIANGLE_OBJ, Service, spoil

pytestmark = pytest.mark.storages

BLOB = "sha256:" + hashlib.sha256(TRIANGLE_OBJ).hexdigest()


def sweep(service: Service, hours_later: float, *, hours: float = 24) -> None:
    """As if so much time had gone by."""
    real = now_ms()
    engine = open_database(service.settings.database)
    later = JobStore(engine, lambda: real + int(hours_later * HOUR_MS))
    designs = DesignCache(service.blobs.store, 10)
    Retention(later, service.blobs, designs, hours, lambda: real + int(hours_later * HOUR_MS)).sweep()
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
    assert service.jobs.known_blobs([BLOB]) == {BLOB}


def test_nothing_goes_where_everything_is_kept(service: Service) -> None:
    job_id = service.finished()
    sweep(service, 1e6, hours=0)
    assert service.status(job_id)["status"] == "successful"
    assert len(kept_files(service)) == 3


def test_a_second_delete_removes_what_the_first_left(
    service: Service, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The API was killed between the row and its files."""
    job_id = service.finished()
    assert service.jobs.remove(job_id)
    assert any("results/" in path for path in kept_files(service))
    assert service.http.delete(f"/v1/jobs/{job_id}").status_code == 204
    assert not any("results/" in path for path in kept_files(service))


def test_a_removed_jobs_files_go_before_its_row(service: Service) -> None:
    """Nobody asks a second time: retention finds them."""
    job_id = service.finished()
    assert service.jobs.remove(job_id)
    sweep(service, 25)
    assert not any("results/" in path for path in kept_files(service))
    assert service.jobs.known_jobs([job_id]) == set()


def test_files_that_cannot_be_deleted_keep_their_row(
    service: Service, monkeypatch: pytest.MonkeyPatch
) -> None:
    job_id = service.finished()
    assert service.jobs.remove(job_id)
    with monkeypatch.context() as away:
        away.setattr(service.blobs, "remove_results", lambda *_: (_ for _ in ()).throw(GenericError("503")))
        sweep(service, 25)
        assert service.jobs.known_jobs([job_id]) == {job_id}
    sweep(service, 25)
    assert service.jobs.known_jobs([job_id]) == set()
    assert kept_files(service) == []


@pytest.mark.parametrize("hours", [0, 24])
def test_bytes_without_a_row_are_found_when_they_are_old(service: Service, hours: float) -> None:
    """Whoever stored them was killed before the row, or whoever forgot them after it."""
    kept = service.finished()
    needed = kept_files(service)
    blob = service.blobs.receive(io.BytesIO(b"o lost"))
    service.blobs.keep(blob)
    stray_job = new_id()
    obstore.put(service.blobs.store, f"results/{stray_job}/1/results.json", b"{}")
    stray = {f"results/{stray_job}/1/results.json", f"blobs/{blob.sha256[:2]}/{blob.sha256}"}
    sweep(service, 5, hours=hours)
    assert set(kept_files(service)) == {*needed, *stray}
    sweep(service, 7, hours=hours)
    assert kept_files(service) == needed
    assert service.status(kept)["status"] == "successful"


def test_kept_analyses_of_designs_go_after_their_time(service: Service) -> None:
    obstore.put(service.blobs.store, "designs/" + "0" * 64, b"an analysis")
    sweep(service, 23)
    assert kept_files(service) == ["designs/" + "0" * 64]
    sweep(service, 25)
    assert kept_files(service) == []


def test_a_job_whose_row_is_damaged_stops_no_retention(service: Service) -> None:
    bad, old = service.submitted(), service.finished()
    spoil(service, bad, inputs="[1]")
    sweep(service, 25)
    assert service.http.get(f"/v1/jobs/{old}").status_code == 404
    assert not any("results/" in path for path in kept_files(service))


def test_a_batch_goes_with_its_last_job(service: Service) -> None:
    blob = service.http.put("/v1/blobs", content=TRIANGLE_OBJ, params={"filename": "a.obj"}).json()["id"]
    ref = {"blob": blob, "filename": "a.obj"}
    request = {"design": ref, "scans": [{"scan": ref}, {"scan": ref}]}
    address = service.http.post("/v1/batches", json=request).headers["Location"]
    for job_id in list(service.waiting):
        service.worker.run(job_id)
    sweep(service, 25)
    assert service.http.get(address).json()["by_status"] == {"successful": 2}
    table = service.http.get(f"{address}/table.csv").text
    assert table.count(",removed,") == 2
    sweep(service, 51)
    sweep(service, 51)
    assert service.http.get(address).status_code == 404
