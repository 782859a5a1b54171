"""Real servers for tests: PostgreSQL from its own binaries, and S3 over HTTP. Both on loopback, both gone
afterwards.
"""

import os
import pwd
import shutil
import socket
import subprocess
import sys
import tempfile
import time
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from urllib.error import URLError

import obstore
import psycopg
from obstore.store import S3Store

START_TIMEOUT_S = 60
S3_WORDS = {"AWS_ACCESS_KEY_ID": "test", "AWS_SECRET_ACCESS_KEY": "test", "AWS_REGION": "us-east-1"}


def free_port() -> int:
    """A port that nobody listens on just now."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


@dataclass
class Postgres:
    """A PostgreSQL server of its own."""

    folder: Path
    port: int
    binaries: Path
    user: str | None  # PostgreSQL refuses to run as root

    def url(self, database: str) -> str:
        return f"postgresql://cusp@127.0.0.1:{self.port}/{database}"

    def create(self, database: str, template: str = "template1") -> str:
        """Make a database. Returns its URL."""
        with psycopg.connect(self.url("postgres"), autocommit=True) as connection:
            connection.execute(f'CREATE DATABASE "{database}" TEMPLATE "{template}"')  # type: ignore[arg-type]
        return self.url(database)

    def drop(self, database: str) -> None:
        with psycopg.connect(self.url("postgres"), autocommit=True) as connection:
            connection.execute(f'DROP DATABASE "{database}" WITH (FORCE)')  # type: ignore[arg-type]

    def start(self) -> None:
        options = f"-p {self.port} -k {self.folder} -c listen_addresses=127.0.0.1"
        options += " -c fsync=off -c max_connections=200"
        log = self.folder / "log"
        self._control("start", "-w", "-l", str(log), "-o", options)

    def stop(self, mode: str = "immediate") -> None:
        self._control("stop", "-m", mode)

    def _control(self, *words: str) -> None:
        subprocess.run(
            [self.binaries / "pg_ctl", "-D", self.folder / "data", *words],
            user=self.user,
            cwd=self.folder,
            check=True,
            stdout=subprocess.DEVNULL,
            timeout=START_TIMEOUT_S,
        )


def postgres_binaries() -> Path | None:
    """Where `initdb` and `pg_ctl` are; Debian keeps them off the PATH."""
    found = [Path(path).resolve().parent for name in ("initdb",) if (path := shutil.which(name))]
    found += sorted(Path("/usr/lib/postgresql").glob("*/bin"), reverse=True)
    return next((folder for folder in found if (folder / "pg_ctl").exists()), None)


@contextmanager
def running_postgres() -> Iterator[Postgres]:
    """Until the end of the block."""
    binaries = postgres_binaries()
    assert binaries is not None, "PostgreSQL is not installed (apt-get install postgresql)"
    folder = Path(tempfile.mkdtemp(prefix="cusp-pg-"))
    user = None
    if os.geteuid() == 0:
        known = {each.pw_name for each in pwd.getpwall()}
        user = "postgres" if "postgres" in known else "nobody"
        shutil.chown(folder, user)
    server = Postgres(folder, free_port(), binaries, user)
    try:
        subprocess.run(
            [
                binaries / "initdb",
                "-D",
                folder / "data",
                "-U",
                "cusp",
                "-A",
                "trust",
                "-E",
                "UTF8",
                "--no-sync",
            ],
            user=user,
            cwd=folder,
            check=True,
            stdout=subprocess.DEVNULL,
            timeout=START_TIMEOUT_S,
        )
        server.start()
        try:
            yield server
        finally:
            server.stop()
    finally:
        shutil.rmtree(folder, ignore_errors=True)


@dataclass
class S3:
    """An S3 server; `environment` is what a client of it needs."""

    endpoint: str
    bucket: str = "cusp"

    @property
    def environment(self) -> dict[str, str]:
        return {"AWS_ENDPOINT_URL": self.endpoint, **S3_WORDS}

    def keys(self, prefix: str) -> list[str]:
        """What is in the bucket."""
        store = S3Store(
            self.bucket,
            endpoint=self.endpoint,
            access_key_id="test",
            secret_access_key="test",  # noqa: S106 (of a server that asks for none)
            region="us-east-1",
            client_options={"allow_http": True},
        )
        return sorted(entry["path"] for batch in obstore.list(store, prefix=prefix) for entry in batch)


@contextmanager
def running_s3() -> Iterator[S3]:
    """Until the end of the block, with one bucket."""
    port = free_port()
    server = S3(f"http://127.0.0.1:{port}")
    with subprocess.Popen(
        [sys.executable, "-W", "ignore", "-m", "moto.server", "-H", "127.0.0.1", "-p", str(port)],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        env={**os.environ, **S3_WORDS},
    ) as process:
        try:
            deadline = time.monotonic() + START_TIMEOUT_S
            while True:
                try:
                    made = urllib.request.Request(f"{server.endpoint}/{server.bucket}", method="PUT")  # noqa: S310
                    urllib.request.urlopen(made, timeout=5).close()  # noqa: S310 (loopback)
                    break
                except URLError:
                    assert process.poll() is None and time.monotonic() < deadline, (
                        "the S3 server does not start"
                    )
                    time.sleep(0.1)
            yield server
        finally:
            process.kill()
