"""What holds for all tests, real meshes for those marked `data`, and servers for those that ask for them."""

from collections.abc import Iterator
from pathlib import Path

import hypothesis
import pytest

from tests.support.data import data_folder
from tests.support.storage import S3, Postgres, postgres_binaries, running_postgres, running_s3

# How long an example takes says how busy the machine is. A test that hangs is ended by pytest-timeout.
hypothesis.settings.register_profile("tests", deadline=None)
hypothesis.settings.load_profile("tests")


@pytest.fixture(scope="session")
def data() -> Path:
    folder = data_folder()
    if folder is None:
        pytest.skip("set CUSP_DATA to the folder of real meshes")
    return folder


@pytest.fixture(scope="session")
def postgres() -> Iterator[Postgres]:
    """A PostgreSQL server, started when a test asks for it."""
    if postgres_binaries() is None:
        pytest.skip("PostgreSQL is not installed (apt-get install postgresql)")
    with running_postgres() as server:
        yield server


@pytest.fixture(scope="session")
def s3() -> Iterator[S3]:
    """An S3 server, started when a test asks for it."""
    with running_s3() as server:
        yield server
