"""Nothing is lost: however the service ends, its jobs finish after the next start."""

from pathlib import Path

import pytest

from tests.support.running import QUICK, RunningService

pytestmark = pytest.mark.e2e

SLOWER = {"settings": {**QUICK["settings"], "resample": {"target_vertices": 2000}}}


def test_jobs_survive_a_kill_of_everything(tmp_path: Path, design: Path, scan: Path) -> None:
    data_dir = tmp_path / "data"
    service = RunningService(data_dir, CUSP_JOBS="1")
    first, second = (service.client.submit(design, scan, options).id for options in (SLOWER, QUICK))
    service.running(first)
    service.kill_everything()

    service = RunningService(data_dir, CUSP_JOBS="1")
    try:
        assert service.successful(first).attempt == 2  # killed, finished
        assert service.successful(second).attempt == 1
        assert service.client.results(first)["transform"] is not None
    finally:
        service.stop()


@pytest.mark.nightly
def test_jobs_survive_a_clean_stop_and_a_kill_of_everything(tmp_path: Path, design: Path, scan: Path) -> None:
    data_dir = tmp_path / "data"
    service = RunningService(data_dir, CUSP_JOBS="1")
    first, second = (service.client.submit(design, scan, options).id for options in (SLOWER, QUICK))
    service.running(first)
    assert service.stop() < 10

    service = RunningService(data_dir, CUSP_JOBS="1")
    assert service.client.job(second).attempt == 0
    service.running(first)
    service.kill_everything()

    service = RunningService(data_dir, CUSP_JOBS="1")
    try:
        assert service.successful(first).attempt == 3  # stopped, killed, finished
        assert service.successful(second).attempt == 1
        assert service.client.results(first)["transform"] is not None
    finally:
        service.stop()
