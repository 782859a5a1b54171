"""Opens and migrates the database: SQLite or PostgreSQL, depending on the URL."""

import logging
import sqlite3
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import resources
from typing import Any

from sqlalchemy import Engine, create_engine, event, make_url, text
from sqlalchemy.engine.interfaces import DBAPIConnection
from sqlalchemy.exc import OperationalError
from sqlalchemy.pool import ConnectionPoolEntry

BUSY_TIMEOUT_MS = (
    10_000  # the API and the worker write to one file; each write takes well under a millisecond
)
CONNECT_TIMEOUT_S = 10
MIGRATION_LOCK = 0x43555350  # of PostgreSQL's advisory locks: "CUSP"


class NoDatabase(Exception):
    """The database does not answer, refuses the connection, or is unsuitable."""


def check_sqlite(url: str) -> None:
    """Refuse SQLite older than 3.42 on Python 3.12 or newer: DBOS writes empty times there and loses the
    order of jobs.

    Raises
    ------
    NoDatabase
    """
    python = tuple(sys.version_info)
    if (
        make_url(url).get_backend_name() == "sqlite"
        and python >= (3, 12)
        and sqlite3.sqlite_version_info < (3, 42)
    ):
        raise NoDatabase(
            f"Python {python[0]}.{python[1]} here has SQLite {sqlite3.sqlite_version}; with it the queue "
            "needs 3.42 or newer: use Python 3.11, a newer system, or PostgreSQL (CUSP_DATABASE_URL)"
        )


def open_database(url: str) -> Engine:
    """An engine on `sqlite:///file` or `postgresql+psycopg://...`.

    SQLite: with WAL, readers continue while one process writes; with FULL, an accepted job survives a loss of
    power. PostgreSQL: connections are tested before use, so a restarted server causes no errors.
    """
    if make_url(url).get_backend_name() == "postgresql":
        return create_engine(url, pool_pre_ping=True, connect_args={"connect_timeout": CONNECT_TIMEOUT_S})
    engine = create_engine(url, connect_args={"timeout": BUSY_TIMEOUT_MS / 1000})
    event.listen(engine, "connect", _prepare_connection)
    return engine


def migrate(url: str) -> None:
    """Migrate the tables to this version; create a missing SQLite file."""
    from alembic import command  # here: a running API does not need it
    from alembic.config import Config

    logging.getLogger("alembic").setLevel(logging.WARNING)
    config = Config()
    config.set_main_option("script_location", str(resources.files("service.storage") / "migrations"))
    config.set_main_option("path_separator", "os")
    engine = open_database(url)
    try:
        with engine.begin() as connection:
            config.attributes["connection"] = connection
            command.upgrade(config, "head")
    finally:
        engine.dispose()


@contextmanager
def migrating(url: str) -> Iterator[None]:
    """Lock out migrations by other machines in the same PostgreSQL database.

    Raises
    ------
    NoDatabase
        With the message of the server, without the password.
    """
    if make_url(url).get_backend_name() != "postgresql":
        yield
        return
    engine = open_database(url)
    try:
        try:
            # Without a transaction: DBOS creates indexes concurrently, which waits for every open
            # transaction.
            connection = engine.connect().execution_options(isolation_level="AUTOCOMMIT")
        except OperationalError as error:
            shown = make_url(url).render_as_string(hide_password=True)
            reason = " ".join(str(error.orig).split())
            raise NoDatabase(f"no database at {shown}: {reason}; see CUSP_DATABASE_URL") from error
        with connection:
            # Poll: a waiting statement would also block the creation of those indexes.
            while not connection.scalar(text("SELECT pg_try_advisory_lock(:key)"), {"key": MIGRATION_LOCK}):
                time.sleep(0.2)
            yield  # closing the connection releases the lock
    finally:
        engine.dispose()


def _prepare_connection(connection: DBAPIConnection, _: ConnectionPoolEntry) -> None:
    cursor: Any = connection.cursor()
    cursor.execute(f"PRAGMA busy_timeout={BUSY_TIMEOUT_MS}")
    cursor.execute("PRAGMA journal_mode=WAL")
    cursor.execute("PRAGMA synchronous=FULL")
    cursor.execute("PRAGMA foreign_keys=ON")
    cursor.close()
