"""Migrations make exactly the tables that the models describe."""

from pathlib import Path

from alembic.autogenerate import compare_metadata
from alembic.migration import MigrationContext
from sqlalchemy import text

from service.jobs import Base
from service.store import migrate, open_database


def test_migrations_and_models_agree(tmp_path: Path) -> None:
    path = tmp_path / "cusp.db"
    migrate(path)
    migrate(path)  # again is nothing
    engine = open_database(path)
    with engine.connect() as connection:
        assert compare_metadata(MigrationContext.configure(connection), Base.metadata) == []
        assert connection.scalar(text("PRAGMA journal_mode")) == "wal"
        assert connection.scalar(text("PRAGMA foreign_keys")) == 1
    engine.dispose()
