"""Migrations make exactly the tables that the models describe."""

import pytest
from alembic.autogenerate import compare_metadata
from alembic.migration import MigrationContext
from sqlalchemy import text

from service.jobs import Base
from service.settings import ServiceSettings
from service.store import migrate, open_database


@pytest.mark.storages
def test_migrations_and_models_agree(settings: ServiceSettings) -> None:
    migrate(settings.database)  # again is nothing
    engine = open_database(settings.database)
    with engine.connect() as connection:
        assert compare_metadata(MigrationContext.configure(connection), Base.metadata) == []
        if settings.is_embedded:
            assert connection.scalar(text("PRAGMA journal_mode")) == "wal"
            assert connection.scalar(text("PRAGMA foreign_keys")) == 1
    engine.dispose()
