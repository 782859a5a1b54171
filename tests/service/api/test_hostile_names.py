"""Names from outside never become paths: of files, jobs, blobs and tenants."""

import http.client
import json
from urllib.parse import quote

import pytest

from tests.support.service import Service

pytestmark = pytest.mark.storages
NAMES = [
    "../results.json",
    "../../../../cusp.db",
    "..\\..\\cusp.db",
    "/etc/passwd",
    "results.json\0",
    "results.json/",
    "results.json/../results.json",
    ".",
    "..",
    "a" * 5000,
    "results.json\r\nX-Evil: 1",
    "résultats.json",
]


def get(service: Service, path: str, method: str = "GET") -> tuple[int, dict[str, str]]:
    """As it stands: httpx would tidy the path first."""
    connection = http.client.HTTPConnection(
        service.http.base_url.host, service.http.base_url.port or 80, timeout=10
    )
    connection.putrequest(method, path, skip_host=True, skip_accept_encoding=True)
    connection.putheader("Host", "localhost")
    connection.endheaders()
    answer = connection.getresponse()
    answer.read()
    connection.close()
    return answer.status, {key.lower(): value for key, value in answer.getheaders()}


@pytest.mark.parametrize("name", NAMES)
def test_a_file_is_one_of_the_jobs_list_or_none(service: Service, name: str) -> None:
    job_id = service.finished()
    assert get(service, f"/v1/jobs/{job_id}/files/results.json")[0] == 200
    for written in {quote(name, safe=""), quote(name, safe="/.")}:
        status, headers = get(service, f"/v1/jobs/{job_id}/files/{written}")
        assert status in (307, 404) and "x-evil" not in headers, (written, status)


@pytest.mark.parametrize("name", NAMES)
def test_a_job_or_blob_of_such_a_name_is_not_there(service: Service, name: str) -> None:
    written = quote(name, safe="")
    for path in (f"/v1/jobs/{written}", f"/v1/jobs/{written}/results", f"/v1/jobs/{written}/files"):
        assert get(service, path)[0] in (307, 404), path
    assert get(service, f"/v1/jobs/{written}", "DELETE")[0] in (307, 404, 405)
    assert get(service, f"/v1/blobs/{written}", "HEAD")[0] in (307, 404)
    body = {"design": {"blob": name}, "scan": {"blob": name}}
    assert service.http.post("/v1/jobs", json=body).status_code == 422


@pytest.mark.parametrize("words", ["'; DROP TABLE jobs; --", "%", "_", "a\\", "\u202e", "x' OR '1'='1"])
def test_words_for_a_query_are_only_words(service: Service, words: str) -> None:
    service.submitted(json.dumps({"label": "mine"}))
    assert service.http.get("/v1/jobs", params={"label": words}).json()["jobs"] == []
    for path in ("/v1/jobs", "/v1/batches", "/v1/deliveries"):  # not taken for a place between the ids
        answer = service.http.get(path, params={"cursor": words})
        assert answer.status_code == 422 and "cursor: must be" in answer.json()["detail"]
    assert len(service.http.get("/v1/jobs").json()["jobs"]) == 1
    job_id = service.submitted(json.dumps({"label": words}))
    (found,) = service.http.get("/v1/jobs", params={"label": words}).json()["jobs"]
    assert (found["id"], found["label"]) == (job_id, words)


def test_a_label_with_a_zero_byte_is_refused(service: Service) -> None:
    """PostgreSQL has no text with it."""
    answer = service.submit(json.dumps({"label": "a\0b"}))
    assert answer.status_code == 422
    assert service.http.get("/v1/jobs", params={"label": "a\0b"}).status_code in (200, 422)
