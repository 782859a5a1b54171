"""The service in this process, on either kind of storage; its parts are in `tests/support/service.py`."""

import shutil
import uuid
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import psycopg
import pytest
import structlog
from psycopg import sql

from service.api.app import create_app
from service.execution.job_tasks import JobTasks
from service.execution.worker import Worker
from service.jobs.metrics import Metrics
from service.jobs.store import JobStore
from service.settings import MIB, ServiceSettings
from service.storage.blobs import BlobStore
from service.storage.database import migrate, open_database
from service.storage.design_cache import DesignCache
from service.webhooks.address_guard import Guard
from service.webhooks.mesh_fetch import MeshFetcher
from tests.support.service import NotingQueue, ScriptedSandbox, Service, http_client, serving
from tests.support.storage import Postgres


@pytest.fixture(autouse=True, scope="session")
def _plain_logs() -> None:
    renderer = structlog.dev.ConsoleRenderer(colors=False, exception_formatter=structlog.dev.plain_traceback)
    structlog.configure(processors=[structlog.stdlib.add_log_level, renderer])


@pytest.fixture(scope="session")
def migrated(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An empty database; copying it is faster than migrating for each test."""
    path = tmp_path_factory.mktemp("migrated") / "cusp.db"
    migrate(f"sqlite:///{path}")
    return path


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """Modules that say `pytestmark = pytest.mark.storages` run on both kinds of storage."""
    if "storage" in metafunc.fixturenames and metafunc.definition.get_closest_marker("storages"):
        metafunc.parametrize("storage", ["embedded", "scaled"], indirect=True)


@pytest.fixture
def storage(request: pytest.FixtureRequest, tmp_path: Path, migrated: Path) -> Iterator[dict[str, Any]]:
    """Settings of where things are: SQLite and files, or PostgreSQL and S3; the tables are made."""
    folder = tmp_path / "data"
    if getattr(request, "param", "embedded") == "embedded":
        folder.mkdir(mode=0o700)
        shutil.copy(migrated, folder / "cusp.db")
        yield {"data_dir": folder}
        return
    s3 = request.getfixturevalue("s3")
    database_url = request.getfixturevalue("postgres_database")
    _empty_tables(database_url)
    with pytest.MonkeyPatch.context() as patch:
        for variable, value in s3.environment.items():
            patch.setenv(variable, value)
        yield {
            "data_dir": folder,
            "database_url": database_url,
            "blob_url": f"s3://{s3.bucket}/t_{uuid.uuid4().hex}",
        }


@pytest.fixture(scope="session")
def postgres_database(postgres: Postgres) -> str:
    """One database for all tests of a process: making one takes longer than emptying its tables."""
    url = postgres.create("tests")
    migrate(ServiceSettings.model_validate({"database_url": url}).database)
    return url


def _empty_tables(database_url: str) -> None:
    """As the migrations leave them: all tables empty."""
    with psycopg.connect(database_url, autocommit=True) as connection:
        query = (
            "SELECT tablename FROM pg_tables WHERE schemaname = 'public' AND tablename <> 'alembic_version'"
        )
        names = sorted(name for (name,) in connection.execute(query))
        connection.execute(sql.SQL("TRUNCATE {}").format(sql.SQL(", ").join(map(sql.Identifier, names))))


@pytest.fixture
def settings(storage: dict[str, Any]) -> ServiceSettings:
    made = ServiceSettings(**storage, max_upload_mib=1, queue_limit=5, mesh_networks="127.0.0.0/8")
    made.make_folders()
    return made


@pytest.fixture
def service(settings: ServiceSettings) -> Iterator[Service]:
    engine = open_database(settings.database)
    jobs, blobs, queue, sandbox = (
        JobStore(engine),
        BlobStore(settings.blobs),
        NotingQueue(),
        ScriptedSandbox(),
    )
    designs, metrics = DesignCache(blobs.store, settings.design_cache_mib), Metrics(engine, settings.data_dir)
    fetcher = MeshFetcher(Guard.of("127.0.0.0/8"), settings.max_upload_mib * MIB, 5.0)
    tasks = JobTasks(jobs, blobs, designs, fetcher)
    worker = Worker("worker-1", jobs, blobs, tasks, sandbox, settings.scratch_dir, metrics)  # type: ignore[arg-type]
    with serving(create_app(settings)) as address, http_client(address) as http:
        yield Service(http, jobs, blobs, queue, sandbox, worker, settings)
    engine.dispose()
