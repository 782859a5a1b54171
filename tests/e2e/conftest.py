"""One service for the tests that leave it as they found it, and the meshes they send."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.support.meshes import SHIFT_MM, TURN_DEG, blob_stl
from tests.support.running import RunningService


@pytest.fixture(scope="session")
def design(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("meshes") / "design.stl"
    path.write_bytes(blob_stl())
    return path


@pytest.fixture(scope="session")
def scan(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The same shape by another triangulation, turned by TURN_DEG about z and then shifted by SHIFT_MM."""
    path = tmp_path_factory.mktemp("meshes") / "scan.stl"
    path.write_bytes(blob_stl(23, 37, turn_deg=TURN_DEG, shift_mm=SHIFT_MM))
    return path


@pytest.fixture(scope="package")
def running(tmp_path_factory: pytest.TempPathFactory) -> Iterator[RunningService]:
    service = RunningService(tmp_path_factory.mktemp("service") / "data", CUSP_JOBS="1")
    yield service
    took = service.stop()
    assert took < 10, f"the service took {took} s to stop"
