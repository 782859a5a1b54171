"""A service without keys answers this machine, and no page of the web that a browser on this machine
shows.
"""

from collections.abc import Iterator

import httpx
import pytest

from service.api.app import create_app
from service.auth.keys import KeyStore, Scope
from service.settings import ServiceSettings
from service.storage.database import open_database
from tests.support.service import TRIANGLE_OBJ, Service, assert_problem, http_client, serving

FILES = {"design": ("d.obj", TRIANGLE_OBJ), "scan": ("s.obj", TRIANGLE_OBJ)}
REBOUND = [
    "evil.example",
    "evil.example:8000",
    "127.0.0.1.nip.io",
    "localhost.evil.example:1",
    "10.0.0.1",
    "[::2]",
    "[",
    "x:y",
]


@pytest.mark.parametrize("host", REBOUND)
def test_a_name_that_was_led_to_this_machine_is_not_answered(service: Service, host: str) -> None:
    """DNS rebinding: to the browser that page has the same origin as we."""
    headers = {"Host": host}
    for answer in (
        service.http.get("/v1/jobs", headers=headers),
        service.http.get("/metrics", headers=headers),
        service.http.put("/v1/blobs", content=TRIANGLE_OBJ, headers=headers),
        service.http.post("/v1/jobs", files=FILES, headers=headers),
    ):
        assert_problem(answer, 403, "forbidden", "localhost", "CUSP_ALLOW_OPEN")
    assert service.waiting == []


@pytest.mark.parametrize(
    "host", ["127.0.0.1", "127.0.0.1:8000", "localhost", "LOCALHOST:80", "localhost.", "[::1]:8000", ""]
)
def test_this_machine_is_answered_by_any_of_its_names(service: Service, host: str) -> None:
    assert service.http.get("/v1/jobs", headers={"Host": host}).status_code == 200


@pytest.mark.parametrize(
    "headers",
    [
        {"Origin": "https://evil.example"},
        {"Origin": "null"},
        {"Origin": "http://["},
        {"Origin": "http://127.0.0.1:1"},
        {"Sec-Fetch-Site": "cross-site"},
    ],
)
def test_a_page_of_another_origin_changes_nothing(service: Service, headers: dict[str, str]) -> None:
    """A form needs nobody's leave to be sent anywhere."""
    job_id = service.submitted()
    for answer in (
        service.http.post("/v1/jobs", files=FILES, headers=headers),
        service.http.put("/v1/blobs", content=TRIANGLE_OBJ, headers=headers),
        service.http.delete(f"/v1/jobs/{job_id}", headers=headers),
    ):
        assert_problem(answer, 403, "forbidden", "origin")
    assert service.waiting == [job_id]


def test_our_own_page_and_a_link_to_us_are_answered(service: Service) -> None:
    own = {"Origin": str(service.http.base_url).rstrip("/"), "Sec-Fetch-Site": "same-origin"}
    assert service.http.post("/v1/jobs", files=FILES, headers=own).status_code == 202
    assert service.http.get("/v1/jobs", headers={"Sec-Fetch-Site": "cross-site"}).status_code == 200


@pytest.fixture
def guarded(settings: ServiceSettings) -> Iterator[httpx.Client]:
    """Something else guards it."""
    opened = settings.model_copy(update={"allow_open": True})
    with serving(create_app(opened)) as address, http_client(address) as http:
        yield http


def test_what_something_else_guards_may_have_any_name(guarded: httpx.Client) -> None:
    behind = {"Host": "cusp.factory.example", "Origin": "https://cusp.factory.example"}
    assert guarded.post("/v1/jobs", files=FILES, headers=behind).status_code == 202
    foreign = {**behind, "Origin": "https://evil.example", "Sec-Fetch-Site": "cross-site"}
    assert_problem(guarded.post("/v1/jobs", files=FILES, headers=foreign), 403, "forbidden")


def test_with_keys_the_key_decides(service: Service) -> None:
    engine = open_database(service.settings.database)
    _, key = KeyStore(engine).create("acme", [Scope.WRITE, Scope.READ])
    engine.dispose()
    headers = {
        "Host": "cusp.factory.example",
        "Origin": "https://mes.factory.example",
        "Authorization": f"Bearer {key}",
    }
    assert service.http.post("/v1/jobs", files=FILES, headers=headers).status_code == 202
