"""Migrations make exactly the tables that the models describe."""

import pytest
from alembic.autogenerate import compare_metadata
from alembic.migration import MigrationContext
from sqlalchemy import text

from service.jobs.models import Base
from service.settings import ServiceSettings
from service.storage.database import NoDatabase, check_sqlite, migrate, open_database


@pytest.mark.storages
def test_migrations_and_models_agree(settings: ServiceSettings) -> None:
    migrate(settings.database)  # again is nothing
    engine = open_database(settings.database)
    with engine.connect() as connection:
        assert compare_metadata(MigrationContext.configure(connection), Base.metadata) == []
        if settings.is_embedded:
            assert connection.scalar(text("PRAGMA journal_mode")) == "wal"
            assert connection.scalar(text("PRAGMA foreign_keys")) == 1
            assert (
                connection.scalar(text("PRAGMA synchronous")) == 2
            )  # FULL: what was accepted outlives a loss of power
    engine.dispose()


@pytest.mark.parametrize(
    ("python", "sqlite", "fits"),
    [((3, 11, 7), (3, 40, 1), True), ((3, 12, 0), (3, 40, 1), False), ((3, 13, 1), (3, 42, 0), True)],
)
def test_a_sqlite_that_the_queue_would_not_work_on_is_refused_at_the_start(
    monkeypatch: pytest.MonkeyPatch, python: tuple[int, ...], sqlite: tuple[int, ...], fits: bool
) -> None:
    monkeypatch.setattr("service.storage.database.sys.version_info", python)
    monkeypatch.setattr("service.storage.database.sqlite3.sqlite_version_info", sqlite)
    check_sqlite("postgresql+psycopg://db/cusp")
    if fits:
        check_sqlite("sqlite:///queue.db")
    else:
        with pytest.raises(NoDatabase, match=r"3\.42"):
            check_sqlite("sqlite:///queue.db")
