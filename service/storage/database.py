"""The database: how it is opened, and how its tables are made. SQLite and PostgreSQL, by the URL alone."""

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
    """The database does not answer, refuses us, or would not do."""


def check_sqlite(url: str) -> None:
    """From Python 3.12 on, DBOS has SQLite older than 3.42 write empty times, and jobs in no order: better not to start.

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

    SQLite: WAL lets readers go on while one writes; FULL has an accepted job outlive a loss of power. PostgreSQL: a
    connection is tried before it is used, so that a restarted server is noticed by nobody.
    """
    if make_url(url).get_backend_name() == "postgresql":
        return create_engine(url, pool_pre_ping=True, connect_args={"connect_timeout": CONNECT_TIMEOUT_S})
    engine = create_engine(url, connect_args={"timeout": BUSY_TIMEOUT_MS / 1000})
    event.listen(engine, "connect", _prepare_connection)
    return engine


def migrate(url: str) -> None:
    """Bring the tables to this version's form; an SQLite file is created when it is missing."""
    from alembic import command  # here: an API that runs has no use for it
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
    """While inside, no other machine makes tables in the same PostgreSQL database.

    Raises
    ------
    NoDatabase
        With what the server said, and never with the password.
    """
    if make_url(url).get_backend_name() != "postgresql":
        yield
        return
    engine = open_database(url)
    try:
        try:
            # Without a transaction: DBOS makes indexes concurrently, which wait for the end of every open one.
            connection = engine.connect().execution_options(isolation_level="AUTOCOMMIT")
        except OperationalError as error:
            shown = make_url(url).render_as_string(hide_password=True)
            reason = " ".join(str(error.orig).split())
            raise NoDatabase(f"no database at {shown}: {reason}; see CUSP_DATABASE_URL") from error
        with connection:
            # Asking again and again, not waiting: a statement that waits would hold up those indexes as well.
            while not connection.scalar(text("SELECT pg_try_advisory_lock(:key)"), {"key": MIGRATION_LOCK}):
                time.sleep(0.2)
            yield  # the lock goes with the connection
    finally:
        engine.dispose()


def _prepare_connection(connection: DBAPIConnection, _: ConnectionPoolEntry) -> None:
    cursor: Any = connection.cursor()
    cursor.execute(f"PRAGMA busy_timeout={BUSY_TIMEOUT_MS}")
    cursor.execute("PRAGMA journal_mode=WAL")
    cursor.execute("PRAGMA synchronous=FULL")
    cursor.execute("PRAGMA foreign_keys=ON")
    cursor.close()
