"""Many machines, as far as processes can be machines: one API and two workers on one PostgreSQL and one
S3.
"""

import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import psutil
import pytest
from sqlalchemy import text

from service.contract.schemas import Status
from service.settings import ServiceSettings
from service.storage.database import open_database
from tests.support.running import QUICK, START_TIMEOUT_S, ScaledService, downloaded, wait_until
from tests.support.storage import S3, Postgres

pytestmark = pytest.mark.e2e
SLOWER = {"settings": {**QUICK["settings"], "resample": {"target_vertices": 2500}}}


@pytest.fixture(scope="module")
def scaled(tmp_path_factory: pytest.TempPathFactory, postgres: Postgres, s3: S3) -> Iterator[ScaledService]:
    service = ScaledService(tmp_path_factory.mktemp("scaled"), postgres, s3, workers=2)
    yield service
    service.stop()


def test_both_workers_take_jobs_and_the_results_are_everywhere(
    scaled: ScaledService, design: Path, scan: Path, s3: S3
) -> None:
    ids = [scaled.client.submit(design, scan, QUICK).id for _ in range(3)]
    for job_id in ids:
        assert scaled.client.wait(job_id, timeout_s=240).status is Status.SUCCESSFUL, scaled.log.read_text()
    documents = [scaled.client.results(job_id) for job_id in ids]
    matrices = {str(document["transform"]["matrix"]) for document in documents}
    assert len(matrices) == 1  # the same bytes from either
    prefix = scaled.environment["CUSP_BLOB_URL"].split("/")[-1]
    assert any(key.endswith(f"{ids[0]}/1/results.json") for key in s3.keys(f"{prefix}/results"))
    engine = open_database(ServiceSettings(database_url=scaled.environment["CUSP_DATABASE_URL"]).database)
    with engine.connect() as connection:
        workers = set(connection.scalars(text("SELECT DISTINCT worker FROM jobs")))
    engine.dispose()
    assert workers == {"worker-0", "worker-1"}


@pytest.mark.nightly
def test_a_killed_workers_job_is_finished_by_another_within_30_s(
    scaled: ScaledService, design: Path, scan: Path
) -> None:
    job_id = scaled.client.submit(design, scan, SLOWER).id
    victim = scaled.busy()
    victim.kill()
    killed_at = time.monotonic()
    wait_until(lambda: scaled.client.job(job_id).attempt == 2, 30, "the other worker to take the job")
    assert time.monotonic() - killed_at < 30
    assert scaled.client.wait(job_id, timeout_s=240).status is Status.SUCCESSFUL
    victim.wait()
    scaled.replace(victim)


@pytest.mark.nightly
def test_a_stopped_workers_job_goes_to_another_at_once(
    scaled: ScaledService, design: Path, scan: Path
) -> None:
    job_id = scaled.client.submit(design, scan, SLOWER).id
    victim = scaled.busy()
    victim.terminate()
    assert victim.wait(10) == 0
    wait_until(lambda: scaled.client.job(job_id).attempt == 2, 10, "the other worker to take the job")
    assert scaled.client.wait(job_id, timeout_s=240).status is Status.SUCCESSFUL
    scaled.replace(victim)


@pytest.mark.nightly
def test_a_worker_that_was_paused_publishes_nothing_when_it_comes_back(
    scaled: ScaledService, design: Path, scan: Path, s3: S3, tmp_path: Path
) -> None:
    """Its machine slept. Meanwhile the job was handed on and finished; its own child finished too, and waits
    to be heard.
    """
    job_id = scaled.client.submit(design, scan, SLOWER).id
    victim = scaled.busy()
    victim.suspend()
    wait_until(lambda: scaled.client.job(job_id).attempt == 2, 40, "the other worker to take the job")
    final = scaled.client.wait(job_id, timeout_s=240)
    assert (final.status, final.attempt) == (Status.SUCCESSFUL, 2)
    victim.resume()
    wait_until(lambda: "no longer wanted" in scaled.log.read_text(), 30, "the paused worker to see it")
    assert scaled.client.job(job_id) == final
    assert "results.json" in downloaded(scaled.client, job_id, tmp_path)
    prefix = scaled.environment["CUSP_BLOB_URL"].split("/")[-1]
    assert {key.split("/")[-2] for key in s3.keys(f"{prefix}/results/{job_id}")} == {"2"}
    after = [scaled.client.submit(design, scan, QUICK).id for _ in range(2)]  # and it works on
    assert {scaled.client.wait(each, timeout_s=240).status for each in after} == {Status.SUCCESSFUL}


@pytest.mark.nightly
def test_a_restart_of_the_database_costs_no_attempt(
    scaled: ScaledService, design: Path, scan: Path, postgres: Postgres
) -> None:
    job_id = scaled.client.submit(design, scan, SLOWER).id
    scaled.busy()
    postgres.stop()
    time.sleep(3)
    postgres.start()
    wait_until(scaled.client.is_ready, START_TIMEOUT_S, "the service to find the database again")
    job = scaled.client.wait(job_id, timeout_s=240)
    assert (job.status, job.attempt) == (Status.SUCCESSFUL, 1), scaled.log.read_text()
    after = scaled.client.submit(design, scan, QUICK).id
    assert scaled.client.wait(after, timeout_s=240).status is Status.SUCCESSFUL


def test_a_second_worker_of_a_name_does_not_start(scaled: ScaledService, tmp_path: Path) -> None:
    scaled.folder = tmp_path  # another machine: another folder
    second = scaled.start("worker", "worker-0")
    try:
        assert second.wait(60) == 3
    finally:
        with suppress(psutil.NoSuchProcess):
            second.kill()
    assert "worker has this name already" in scaled.log.read_text()


def test_a_part_alone_needs_a_database_of_all(tmp_path: Path) -> None:
    for words, environment in {
        "needs CUSP_DATABASE_URL": {},
        "no database at postgresql+psycopg://me:***@127.0.0.1:1/x": {
            "CUSP_DATABASE_URL": "postgresql://me:secret@127.0.0.1:1/x"
        },
    }.items():
        told = subprocess.run(
            [sys.executable, "-m", "service.cli.main", "worker"],
            env={"PATH": "", "CUSP_DATA_DIR": str(tmp_path), **environment},
            capture_output=True,
            text=True,
            timeout=60,
        )
        assert told.returncode == 1 and words in told.stderr and "secret" not in told.stderr, told.stderr
