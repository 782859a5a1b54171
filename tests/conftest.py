"""What holds for all tests, real meshes for those marked `data`, and servers for those that ask for them."""

from collections import Counter
from collections.abc import Iterator
from itertools import zip_longest
from pathlib import Path

import hypothesis
import pytest
from xdist.scheduler import LoadFileScheduling

from tests.support.data import data_folder
from tests.support.storage import S3, Postgres, postgres_binaries, running_postgres, running_s3

# How long an example takes says how busy the machine is. A test that hangs is ended by pytest-timeout.
hypothesis.settings.register_profile("tests", deadline=None)
hypothesis.settings.load_profile("tests")

#: End-to-end tests that use the service of `tests/e2e/conftest.py`.
ONE_SERVICE = {f"test_{name}.py" for name in ("client", "commands", "hostile", "service")}
ONE_SERVICE |= {f"test_{name}.py" for name in ("page", "page_jobs", "page_part", "page_viewer")}


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Each test gets an id of its own: of tests that share one, pytest-xdist silently runs only one."""
    for item in items:
        operation = getattr(item, "operation_label", None)
        if operation and "[" not in item.nodeid:  # schemathesis 4.32 leaves the ids of pytest 9.2 without it
            item._id = item._id.with_params(operation)  # type: ignore[attr-defined]
    _interleave(items)
    repeated = [each for each, count in Counter(item.nodeid for item in items).items() if count > 1]
    if repeated:
        raise pytest.UsageError(f"tests that share an id: {', '.join(repeated)}")


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: object) -> LoadFileScheduling:
    """Files to workers, as `--dist loadfile`; but those that share a service and a browser to one, so that
    both are started once, and their jobs done once.
    """
    return _WholeServices(config, log)


class _WholeServices(LoadFileScheduling):
    def _split_scope(self, nodeid: str) -> str:
        file: str = super()._split_scope(nodeid)
        return "tests/e2e" if Path(file).name in ONE_SERVICE and "e2e" in Path(file).parts else file


def _interleave(items: list[pytest.Item]) -> None:
    """Files of end-to-end tests, which mostly wait, between those that compute: workers take them in turn."""
    whole = list(dict.fromkeys(item.path for item in items if item.get_closest_marker("e2e")))
    others = list(dict.fromkeys(item.path for item in items if not item.get_closest_marker("e2e")))
    order = [path for pair in zip_longest(whole, others) for path in pair if path is not None]
    number = {path: position for position, path in enumerate(order)}
    items.sort(key=lambda item: number[item.path])


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
