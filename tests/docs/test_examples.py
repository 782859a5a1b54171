"""Shell and Python examples of README and docs are run as they are written, against one running service.

Two things are changed before a run: the address http://127.0.0.1:8000 becomes that of the service under test,
and fast settings are added to each job, so that the examples take seconds.
"""

import json
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from service.client import Client
from tests.support.markdown import DOCS, README, blocks, pages
from tests.support.meshes import blob_stl
from tests.support.running import RunningService, wait_until
from tests.support.storage import free_port

pytestmark = pytest.mark.e2e

ADDRESS = "http://127.0.0.1:8000"
FAST = {  # the whole method on small meshes; the verdict of the examples stays `ok`
    "resample": {"target_vertices": 300},
    "features": {"target_vertices": 300},
    "matching": {"max_hypotheses": 4, "dense_pairs": False, "sample_points": 200, "max_pairs": 300},
    "registration": {"sample_points": 500},
}
WAIT = "curl -sf -H 'Prefer: wait=60' $URL/v1/jobs/$JOB"
TRIALS = 20


@pytest.fixture(scope="module")
def running(tmp_path_factory: pytest.TempPathFactory) -> Iterator[RunningService]:
    folder = tmp_path_factory.mktemp("service") / "data"
    service = RunningService(folder, CUSP_JOBS="1", CUSP_WEBHOOK_NETWORKS="127.0.0.0/8")
    yield service
    service.stop()


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with the meshes that examples name."""
    design, scan = blob_stl(), blob_stl(23, 37, turn_deg=25.0, shift_mm=(4.0, -3.0, 2.0))
    for name, content in {"design.stl": design, "part.stl": design, "scan.stl": scan}.items():
        (tmp_path / name).write_bytes(content)
    shutil.copy(tmp_path / "scan.stl", tmp_path / "scan.ply")  # formats are recognised by their content
    return tmp_path


def run(command: list[str], folder: Path) -> str:
    environment = {**os.environ, "NO_PROXY": "*", "no_proxy": "*"}
    done = subprocess.run(
        command, cwd=folder, env=environment, capture_output=True, text=True, timeout=280, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def sh_examples() -> list[tuple[str, str]]:
    return [(page.name, block) for page in pages() for block in blocks(page, "sh")]


@pytest.mark.parametrize(("page", "block"), sh_examples(), ids=[name for name, _ in sh_examples()])
def test_shell_examples_work(page: str, block: str, running: RunningService, folder: Path) -> None:
    fast = json.dumps(FAST)
    script = block.replace(ADDRESS, running.client.server)
    in_quotes = '\\"tolerance_mm\\": 0.2'  # within a shell string in double quotes
    script = script.replace(in_quotes, in_quotes + ', \\"settings\\": ' + fast.replace('"', '\\"'))
    script = script.replace('{"tolerance_mm": 0.2}', f'{{"tolerance_mm": 0.2, "settings": {fast}}}')
    script = script.replace('{"units": {"mesh": "mm"}}', f'{{"units": {{"mesh": "mm"}}, "settings": {fast}}}')
    script = script.replace(
        "-F scan=@scan.stl $URL", f"-F scan=@scan.stl -F 'options={{\"settings\": {fast}}}' $URL"
    )
    script = re.sub(
        rf"^{re.escape(WAIT)}.*$", "; ".join([WAIT] * 4), script, flags=re.MULTILINE
    )  # a busy machine
    printed = run(["bash", "-euxo", "pipefail", "-c", script], folder)
    assert "application/problem+json" not in printed
    assert '"failed"' not in printed


def python_examples(wanted: str) -> list[tuple[str, str]]:
    return [
        (page.name, block)
        for page in (README, *sorted(DOCS.glob("*.md")))
        for block in blocks(page, "python")
        if re.search(wanted, block, re.MULTILINE)
    ]


CLIENT = python_examples(r"^from service\.client import")
LIBRARY = python_examples(r"^from pipeline import")
RECEIVER = python_examples(r"HTTPServer")


def test_every_python_example_is_run_below() -> None:
    assert len(CLIENT) + len(LIBRARY) + len(RECEIVER) == len(python_examples("")) > 3


@pytest.mark.parametrize(("page", "block"), CLIENT, ids=[name for name, _ in CLIENT])
def test_client_examples_work(page: str, block: str, running: RunningService, folder: Path) -> None:
    server = running.client.server
    script = block.replace(ADDRESS, server).replace(
        "tolerance_mm=0.2", f"tolerance_mm=0.2, settings={FAST!r}"
    )
    script = script.replace("timeout_s=120", "timeout_s=240")  # a busy machine
    printed = run([sys.executable, "-c", script], folder)
    assert re.search(r"\bok\b", printed), printed
    if 'download("result")' in block:
        assert (folder / "result" / "report.html").exists()


@pytest.mark.parametrize(("page", "block"), LIBRARY, ids=[name for name, _ in LIBRARY])
def test_library_examples_work(page: str, block: str, folder: Path) -> None:
    script = block.replace("Settings()", "FAST").replace('"part.stl"', '"part.stl", settings=FAST')
    script = script.replace("trials=1000", f"trials={TRIALS}")
    script = f"import pipeline\nFAST = pipeline.Settings.model_validate({FAST!r})\n{script}"
    printed = run([sys.executable, "-c", script], folder)
    assert printed.startswith("ok "), printed
    assert (folder / "result" / "results.json").exists()


def test_the_webhook_receiver_works(running: RunningService, folder: Path) -> None:
    ((_, receiver),) = RECEIVER
    secret = run(
        [sys.executable, "-m", "service.cli.main", "webhooks", "secret", "--data-dir", str(running.data_dir)],
        folder,
    ).strip()
    port = free_port()
    heard = folder / "heard"
    environment = {**os.environ, "CUSP_WEBHOOK_SECRET": secret, "PORT": str(port)}
    with heard.open("w") as log:
        process = subprocess.Popen([sys.executable, "-c", receiver], env=environment, stdout=log, stderr=log)
    try:
        with Client(running.client.server) as cusp:
            job = cusp.landmarks(
                folder / "design.stl", settings=FAST, webhook={"url": f"http://127.0.0.1:{port}/"}
            )
            line = f"job.successful {job.id}"
            wait_until(lambda: line in heard.read_text(), 120, "the message to arrive")
    finally:
        process.kill()
        process.wait()
