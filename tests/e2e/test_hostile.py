"""Files that mean harm, from the request to the end of the job: each is refused or fails with its reason, and
the next runs.
"""

import io
import struct
import zipfile
from pathlib import Path

import pytest

from pipeline import PipelineError
from service.client.sync import ServiceProblem
from service.contract.errors import TABLE
from service.contract.schemas import Status
from tests.support.broken_meshes import cases
from tests.support.running import QUICK, RunningService
from tests.support.settings import TINY

pytestmark = pytest.mark.e2e
MIB = 1024 * 1024
MUTATED = 12
REASONS = {vars(error)["code"] for error in TABLE if issubclass(error, PipelineError)}


def bomb(mib: int, *, claimed_bytes: int | None = None) -> bytes:
    """A 3MF that unpacks to so much. claimed_bytes : what it says instead"""
    made = io.BytesIO()
    with (
        zipfile.ZipFile(made, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive,
        archive.open("3D/3dmodel.model", "w", force_zip64=False) as model,
    ):
        for _ in range(mib):
            model.write(b" " * MIB)
    content = made.getvalue()
    if claimed_bytes is None:
        return content
    return content.replace(struct.pack("<I", mib * MIB), struct.pack("<I", claimed_bytes))


@pytest.mark.parametrize(
    ("mib", "claimed_bytes", "code"), [(300, None, "mesh_too_large"), (100, 1000, "unreadable_file")]
)
def test_a_zip_bomb_fails_its_job_with_its_reason(
    running: RunningService, design: Path, tmp_path: Path, mib: int, claimed_bytes: int | None, code: str
) -> None:
    path = tmp_path / "scan.3mf"
    path.write_bytes(bomb(mib, claimed_bytes=claimed_bytes))
    assert path.stat().st_size < 3 * MIB
    worker = running.part("worker").pid
    job = running.finish(running.client.submit(design, path, QUICK).id)
    assert job.status is Status.FAILED and job.error is not None
    assert (job.error.code, job.error.mesh) == (code, "scan")
    assert running.part("worker").pid == worker


def test_broken_meshes_are_refused_or_fail_with_a_reason_and_the_next_job_runs(
    running: RunningService, design: Path, scan: Path, tmp_path: Path
) -> None:
    """A few of those that `tests/service/execution/test_malformed_meshes.py` gives to the child alone."""
    processes = running.part("api").pid, running.part("worker").pid
    ids, refused = [], []
    for number, (ending, content) in enumerate(cases(MUTATED)):
        path = tmp_path / f"{number}.{ending}"
        path.write_bytes(content)
        try:
            ids.append(running.client.submit(path, options={"settings": TINY}, job_type="landmarks").id)
        except ServiceProblem as error:
            refused.append(error.problem)
    jobs = [running.finish(job_id) for job_id in ids]
    failed = [job.error for job in jobs if job.status is not Status.SUCCESSFUL]
    assert len(ids) + len(refused) == MUTATED
    assert all(
        problem is not None and problem.code in REASONS and problem.status < 500
        for problem in failed + refused
    )
    assert failed
    running.successful(running.client.submit(design, scan, QUICK).id)
    assert (running.part("api").pid, running.part("worker").pid) == processes
