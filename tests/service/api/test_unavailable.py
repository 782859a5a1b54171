"""A database or a store that is away: every address says `not_ready`, with when to ask again, and no stack in
the log.
"""

from collections.abc import Iterator

import httpx
import pytest
from obstore.exceptions import GenericError
from sqlalchemy import text
from sqlalchemy.exc import OperationalError
from sqlalchemy.exc import TimeoutError as PoolTimeout

from service.api.app import create_app
from service.settings import ServiceSettings
from service.storage.database import open_database
from tests.support.service import TRIANGLE_OBJ, Service, assert_problem, http_client, serving

ADDRESSES = [
    "/readyz",
    "/metrics",
    "/v1/jobs",
    "/v1/jobs/x",
    "/v1/jobs/x/results",
    "/v1/jobs/x/files",
    "/v1/limits",
]
FILES = {"design": ("d.obj", TRIANGLE_OBJ), "scan": ("s.obj", TRIANGLE_OBJ)}


@pytest.fixture
def without_tables(settings: ServiceSettings) -> Iterator[httpx.Client]:
    """Its database answers nothing any more."""
    with serving(create_app(settings)) as address, http_client(address) as http:
        engine = open_database(settings.database)
        with engine.begin() as connection:
            for table in ("jobs", "blobs", "workers", "counters", "api_keys"):
                connection.execute(text(f"DROP TABLE {table}"))
        engine.dispose()
        yield http


def test_without_a_database_everything_is_not_ready(
    without_tables: httpx.Client, capsys: pytest.CaptureFixture[str]
) -> None:
    answers = [without_tables.get(address) for address in ADDRESSES]
    answers += [
        without_tables.put("/v1/blobs", content=TRIANGLE_OBJ),
        without_tables.post("/v1/jobs", files=FILES),
        without_tables.delete("/v1/jobs/x"),
    ]
    for answer in answers:
        assert_problem(answer, 503, "not_ready", "the database does not answer")
        assert answer.headers["Retry-After"] == "5"
    assert without_tables.get("/livez").status_code == 200
    assert "Traceback" not in capsys.readouterr().out


@pytest.mark.parametrize(
    ("error", "words"),
    [
        (OperationalError("SELECT", {}, Exception("server closed the connection")), "the database"),
        (PoolTimeout("QueuePool limit of size 5 overflow 10 reached"), "the database"),
        (GenericError("Generic S3 error: 503 SlowDown"), "the store of files"),
        (GenericError("Generic LocalFileSystem error: No space left on device (os error 28)"), "no room"),
        (OSError(28, "No space left on device"), "no room"),
        (OSError(122, "Disk quota exceeded"), "no room"),
    ],
)
def test_what_passes_is_told_apart_from_a_mistake(
    service: Service, monkeypatch: pytest.MonkeyPatch, error: Exception, words: str
) -> None:
    def fail(*_: object, **__: object) -> None:
        raise error

    monkeypatch.setattr("service.storage.blobs.UploadWriter.write", fail)
    assert_problem(service.http.put("/v1/blobs", content=TRIANGLE_OBJ), 503, "not_ready", words)
    assert_problem(service.submit(), 503, "not_ready", words)
    assert not [path for path in service.settings.blob_dir.rglob("*") if path.is_file()]


@pytest.mark.parametrize(
    "error", [ValueError("odd"), FileNotFoundError("a file that should be there"), KeyError("x")]
)
def test_a_mistake_stays_one(service: Service, monkeypatch: pytest.MonkeyPatch, error: Exception) -> None:
    def fail(*_: object, **__: object) -> None:
        raise error

    monkeypatch.setattr("service.storage.blobs.UploadWriter.write", fail)
    assert_problem(service.http.put("/v1/blobs", content=TRIANGLE_OBJ), 500, "internal_error")
