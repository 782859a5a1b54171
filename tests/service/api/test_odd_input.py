"""Requests that no client of good will sends: each is refused with its reason, never by a 500, and leaves
nothing behind.
"""

import hashlib
import json
import socket
from typing import Any

import httpx
import obstore
import pytest

from service.api.digests import content_digest
from service.storage.blobs import UploadWriter
from tests.support.service import TRIANGLE_OBJ, Service, assert_problem

JSON = {"Content-Type": "application/json"}


def stored(service: Service) -> list[str]:
    batches = obstore.list(service.blobs.store)
    return [entry["path"] for batch in batches for entry in batch]


@pytest.mark.parametrize("body", ["[" * 100_000, '{"options":' * 20_000, '{"a":[' * 50_000])
def test_json_that_is_nested_too_deeply_is_refused(service: Service, body: str) -> None:
    assert_problem(service.http.post("/v1/jobs", content=body, headers=JSON), 400, "bad_request", "nested")
    assert_problem(service.submit(options=body), 400, "bad_request", "options", "nested")


@pytest.mark.parametrize("depth", [100, 300, 900])
@pytest.mark.parametrize(("opening", "closing"), [("[", "]"), ('{"a":', "}")])
def test_json_that_is_just_read_is_refused_by_its_meaning(
    service: Service, depth: int, opening: str, closing: str
) -> None:
    deep = opening * depth + "1" + closing * depth
    for options in (
        deep,
        f'{{"settings": {deep}}}',
        f'{{"settings": {{"clean": {deep}}}}}',
        f'{{"study": {deep}}}',
    ):
        answer = service.submit(options)
        assert answer.status_code in (400, 422), answer.text
        body = f'{{"type": "registration", "options": {options}}}'
        assert service.http.post("/v1/jobs", content=body, headers=JSON).status_code in (400, 422)


@pytest.mark.parametrize("number", ["1" * 5000, "1e999", "-1e999", "NaN", "1" + "0" * 400])
def test_numbers_beyond_all_bounds_are_refused(service: Service, number: str) -> None:
    for options in (
        f'{{"seed": {number}}}',
        f'{{"tolerance_mm": {number}}}',
        f'{{"settings": {{"clean": {number}}}}}',
    ):
        assert service.submit(options).status_code in (400, 422)


@pytest.mark.parametrize(
    "digest", ["sha-256=:ä:", "sha-256=:\xff\xfe:", "sha-256=:====:", "sha-256=:A:", "sha-256=::"]
)
def test_a_digest_that_is_none_is_refused_and_nothing_stays(service: Service, digest: str) -> None:
    headers = {"Content-Digest": digest.encode("latin-1")}
    answer = service.http.put("/v1/blobs", content=TRIANGLE_OBJ, headers=headers)  # type: ignore[arg-type]
    assert answer.status_code in (400, 422), answer.text
    assert stored(service) == []


@pytest.mark.parametrize("as_json", [False, True])
def test_the_digest_of_a_job_is_held_against_its_body(service: Service, as_json: bool) -> None:
    blob = service.http.put("/v1/blobs", content=TRIANGLE_OBJ).json()["id"]
    given: dict[str, Any] = (
        {"json": {"design": {"blob": blob}, "scan": {"blob": blob}}}
        if as_json
        else {"files": {"design": ("d.obj", TRIANGLE_OBJ), "scan": ("s.obj", TRIANGLE_OBJ)}}
    )
    request = service.http.build_request("POST", "/v1/jobs", **given)
    right = content_digest(hashlib.sha256(request.read()).hexdigest())
    for digest, status in ((right, 202), (content_digest("0" * 64), 422)):
        request.headers["Content-Digest"] = digest
        answer = service.http.send(request)
        assert answer.status_code == status, answer.text
    assert answer.json()["code"] == "digest_mismatch"
    assert len(service.waiting) == 1


def test_when_the_second_mesh_cannot_be_stored_the_first_does_not_stay(
    service: Service, monkeypatch: pytest.MonkeyPatch
) -> None:
    finish, left = UploadWriter.finish, [1]

    def finishing(writer: UploadWriter) -> Any:
        if not left:
            raise OSError(28, "No space left on device")
        left.pop()
        return finish(writer)

    monkeypatch.setattr(UploadWriter, "finish", finishing)
    answer = service.submit()
    assert_problem(answer, 503, "not_ready", "no room is left on the disk")
    assert answer.headers["Retry-After"] == "5"
    assert stored(service) == []


def test_a_client_that_goes_away_is_no_mistake_of_ours(
    service: Service, capsys: pytest.CaptureFixture[str]
) -> None:
    address = httpx.URL(str(service.http.base_url))
    for head in ("PUT /v1/blobs HTTP/1.1", "POST /v1/jobs HTTP/1.1\r\nContent-Type: application/json"):
        with socket.create_connection((address.host, address.port)) as connection:
            connection.sendall(f"{head}\r\nHost: {address.host}\r\nContent-Length: 100\r\n\r\nabc".encode())
    said = ""
    for _ in range(200):
        said += capsys.readouterr().out
        if said.count("client closed the connection") == 2:
            break
        assert service.http.get("/livez").status_code == 200
    assert (
        said.count("client closed the connection") == 2
        and "Traceback" not in said
        and "unexpected error" not in said
    )
    assert stored(service) == []


def test_a_body_of_json_is_not_taken_for_text_of_another_kind(service: Service) -> None:
    for body in (b"\xff\xfe{}", b"", b"null", b'"x"', json.dumps([1]).encode()):
        assert service.http.post("/v1/jobs", content=body, headers=JSON).status_code in (400, 422)


def test_a_detector_that_is_named_twice_is_refused(service: Service) -> None:
    twice = ["t2", "random"] * 3
    for options in ({"study": {"detectors": twice}}, {"settings": {"study": {"detectors": twice}}}):
        answer = service.submit_one("study", json.dumps(options))
        assert_problem(answer, 422, "invalid_options", "twice")
        (path,) = (each["pointer"] for each in answer.json()["errors"])
        assert path.endswith("study/detectors")
    assert service.submit_one("study", '{"study": {"detectors": ["t2", "random"]}}').status_code == 202
