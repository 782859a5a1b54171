"""The whole service over real HTTP: real worker, real child processes, the real method."""

import math
import signal
import struct
import time
from pathlib import Path

import numpy as np
import pytest

import pipeline
from pipeline import Stage
from service.client.sync import ServiceProblem
from service.contract.schemas import Status
from tests.support.meshes import SHIFT_MM, TURN_DEG, stl
from tests.support.running import LONG, QUICK, RunningService, downloaded, is_alive, wait_until

pytestmark = pytest.mark.e2e


def test_a_scan_is_registered_to_its_design(
    running: RunningService, design: Path, scan: Path, tmp_path: Path
) -> None:
    job = running.client.submit(design, scan, {**QUICK, "tolerance_mm": 0.5, "label": "e2e"})
    assert job.status is Status.ACCEPTED
    seen = []
    final = running.client.wait(job.id, lambda now: seen.append(now.progress), interval_s=0.05, timeout_s=240)
    assert final.status is Status.SUCCESSFUL, final.error
    assert seen == sorted(seen)
    results = pipeline.RegistrationResult.model_validate(running.client.results(job.id))
    assert results.verdict.status == "ok"
    assert results.transform is not None
    c, s = math.cos(math.radians(TURN_DEG)), math.sin(math.radians(TURN_DEG))
    T_scan_design = np.array(
        [[c, -s, 0, SHIFT_MM[0]], [s, c, 0, SHIFT_MM[1]], [0, 0, 1, SHIFT_MM[2]], [0, 0, 0, 1]]
    )
    off = np.array(results.transform.matrix) @ T_scan_design
    assert np.allclose(off[:3, :3], np.eye(3), atol=0.02)
    assert np.abs(off[:3, 3]).max() < 0.4  # 1 % of the diagonal; two coarse triangulations of one shape

    assert downloaded(running.client, job.id, tmp_path) == {"results.json", *results.files}


FILES = {
    "landmarks": {
        *("results.json", "landmarks.csv", "mesh.clean.ply", "mesh.vertices.csv", "mesh.segments.ply"),
        *("mesh.decision_graph.svg", "report.html"),
    },
    "study": {"results.json", "trials.csv", "study.svg", "report.html"},
}
STUDY = {**QUICK, "study": {"trials": 20, "detectors": ["t2", "iss", "random"]}}


def test_landmarks_of_one_mesh(running: RunningService, design: Path, tmp_path: Path) -> None:
    job = running.client.submit(design, options={**QUICK, "units": {"mesh": "cm"}}, job_type="landmarks")
    assert (job.type, job.status) == ("landmarks", Status.ACCEPTED)
    running.successful(job.id)
    results = pipeline.LandmarksResult.model_validate(running.client.results(job.id))
    assert results.provenance.inputs.mesh.mm_per_unit == 10.0
    assert results.segments.mesh.count > 0
    assert len(results.landmarks.mesh) > 0
    assert downloaded(running.client, job.id, tmp_path) == FILES["landmarks"]
    rows = (tmp_path / "landmarks.csv").read_text().splitlines()
    assert len(rows) == 1 + len(results.landmarks.mesh)


def test_a_study_of_one_mesh(running: RunningService, design: Path, tmp_path: Path) -> None:
    job = running.client.submit(design, options=STUDY, job_type="study")
    seen: list[tuple[Stage | None, float]] = []
    running.client.wait(
        job.id, lambda now: seen.append((now.stage, now.progress)), interval_s=0.02, timeout_s=240
    )
    assert running.successful(job.id).type == "study"
    assert [progress for _, progress in seen] == sorted(progress for _, progress in seen)
    results = pipeline.StudyResult.model_validate(running.client.results(job.id))
    assert (results.protocol.kind, results.protocol.trials) == ("informativeness", 20)
    assert results.informativeness is not None
    assert {row.detector for row in results.informativeness} == {"t2", "iss", "random"}
    assert downloaded(running.client, job.id, tmp_path) == FILES["study"]


def test_a_running_study_is_cancelled_within_three_seconds(running: RunningService, design: Path) -> None:
    job = running.client.submit(design, options={**QUICK, "study": {"trials": 1_000_000}}, job_type="study")
    process = running.running(job.id)
    wait_until(lambda: running.client.job(job.id).stage is Stage.STUDY, 60, "the study to begin")
    family = [process, *process.children(recursive=True)]
    begun = time.monotonic()
    running.client.dismiss(job.id)
    wait_until(lambda: not any(map(is_alive, family)), 3, "its processes to be gone")
    assert time.monotonic() - begun < 3
    assert running.client.job(job.id).status is Status.DISMISSED


def test_a_mesh_that_only_the_parser_can_refuse_fails_its_job(
    running: RunningService, design: Path, tmp_path: Path
) -> None:
    bad = tmp_path / "nan.stl"
    nan = (math.nan, 0.0, 0.0)
    bad.write_bytes(stl([[nan, (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)]] * 20))
    job = running.finish(running.client.submit(design, bad).id)
    assert job.status is Status.FAILED
    assert job.error is not None
    assert (job.error.mesh, job.error.status) == ("scan", 422)
    with pytest.raises(ServiceProblem) as refusal:
        running.client.results(job.id)
    assert refusal.value.problem == job.error


def test_a_file_that_cannot_be_a_mesh_is_refused_at_once(
    running: RunningService, design: Path, tmp_path: Path
) -> None:
    bad = tmp_path / "bomb.stl"
    bad.write_bytes(b"x".ljust(80) + struct.pack("<I", 2**32 - 2) + b"\0" * 500)
    with pytest.raises(ServiceProblem, match="scan: the STL header announces 4294967294 triangles"):
        running.client.submit(design, bad)


def test_the_process_that_jobs_are_forked_from_has_one_thread(running: RunningService) -> None:
    (zygote,) = [
        each for each in running.part("worker").children() if "service.execution.zygote" in each.cmdline()
    ]
    assert zygote.num_threads() == 1


def test_a_running_job_is_cancelled_within_three_seconds(
    running: RunningService, design: Path, scan: Path
) -> None:
    job = running.client.submit(design, scan, LONG)
    process = running.running(job.id)
    begun = time.monotonic()
    running.client.dismiss(job.id)
    wait_until(lambda: not is_alive(process), 3, "the process to be gone")
    assert time.monotonic() - begun < 3
    assert running.client.job(job.id).status is Status.DISMISSED


def test_a_segfault_fails_its_job_and_nothing_else(running: RunningService, design: Path, scan: Path) -> None:
    first, second = running.client.submit(design, scan, LONG), running.client.submit(design, scan, QUICK)
    running.running(first.id).send_signal(signal.SIGSEGV)
    failed = running.finish(first.id, 20)
    assert failed.error is not None
    assert failed.error.code == "job_crashed"
    assert "SIGSEGV" in failed.error.detail
    running.successful(second.id)


def test_a_dead_worker_is_replaced_and_its_job_runs_again(
    running: RunningService, design: Path, scan: Path
) -> None:
    job = running.client.submit(design, scan, {**QUICK, "settings": {"resample": {"target_vertices": 2000}}})
    process = running.running(job.id)
    running.part("worker").kill()
    wait_until(lambda: not is_alive(process), 5, "its child to be gone")
    assert running.successful(job.id).attempt == 2


def test_a_dead_api_is_replaced_and_knows_its_jobs(running: RunningService, design: Path, scan: Path) -> None:
    job = running.client.submit(design, scan, QUICK)
    running.part("api").kill()
    wait_until(running.client.is_ready, 60, "the new API")
    running.successful(job.id)
