"""A commit of any connection to an SQLite database is heard of; what else happens beside it is not."""

import threading
from pathlib import Path

import sqlalchemy

from service.storage.commit_watch import CommitWatch
from service.storage.database import open_database


def test_a_commit_is_heard_and_nothing_else(tmp_path: Path) -> None:
    url = f"sqlite:///{tmp_path / 'cusp.db'}"
    watch = CommitWatch.of(url)
    assert watch is not None
    engine, other = open_database(url), open_database(f"sqlite:///{tmp_path / 'queue.db'}")
    for written in (engine, other):
        with written.begin() as connection:
            connection.execute(sqlalchemy.text("CREATE TABLE t (x INTEGER)"))
    assert watch.wait(1.0)
    watch.has_commit()
    with other.begin() as connection:
        connection.execute(sqlalchemy.text("INSERT INTO t VALUES (1)"))
    with engine.connect() as connection:
        connection.execute(sqlalchemy.text("SELECT x FROM t")).all()
    assert not watch.has_commit()
    with engine.begin() as connection:
        connection.execute(sqlalchemy.text("INSERT INTO t VALUES (1)"))
    assert watch.wait(1.0) and not watch.has_commit()
    watch.close()


def test_what_is_heard_can_be_read(tmp_path: Path) -> None:
    """The log is written before its content is flushed to the disk, and shown to readers only then."""
    url = f"sqlite:///{tmp_path / 'cusp.db'}"
    writer, reader = open_database(url), open_database(url)
    with writer.begin() as connection:
        connection.execute(sqlalchemy.text("CREATE TABLE t (x INTEGER)"))
    watch = CommitWatch.of(url)
    assert watch is not None

    def write(number: int) -> None:
        with writer.begin() as connection:
            connection.execute(sqlalchemy.text("INSERT INTO t VALUES (:x)"), {"x": number})

    for number in range(1, 21):
        thread = threading.Thread(target=write, args=(number,))
        thread.start()
        assert watch.wait(10.0)
        with reader.connect() as connection:
            assert connection.execute(sqlalchemy.text("SELECT max(x) FROM t")).scalar() == number
        thread.join()
    assert not watch.has_commit()
    watch.close()


def test_postgresql_and_a_database_in_memory_have_none() -> None:
    assert CommitWatch.of("postgresql+psycopg://cusp@localhost/cusp") is None
    assert CommitWatch.of("sqlite://") is None
