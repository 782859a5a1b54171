"""The README's lines are run as they stand.

Every ```sh block that has a `curl` line is run, in order, by one shell, in a folder with design.stl and scan.stl;
only the address http://127.0.0.1:8000 is replaced by that of the service under test.
"""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.support.running import QUICK, RunningService, wait_until
from tests.support.storage import free_port

pytestmark = pytest.mark.e2e

README = Path(__file__).parents[2] / "README.md"
DEFAULT_ADDRESS = "http://127.0.0.1:8000"


def curl_blocks(text: str) -> list[str]:
    blocks: list[str] = re.findall(r"^```sh\n(.*?)^```", text, re.MULTILINE | re.DOTALL)
    return [block for block in blocks if re.search(r"\bcurl\b", block)]


def test_the_readmes_curl_lines_work(
    running: RunningService, design: Path, scan: Path, tmp_path: Path
) -> None:
    blocks = curl_blocks(README.read_text())
    assert blocks, "README.md has no ```sh block with curl"
    shutil.copy(design, tmp_path / "design.stl")
    shutil.copy(scan, tmp_path / "scan.stl")
    script = "set -euxo pipefail\n" + "\n".join(blocks).replace(DEFAULT_ADDRESS, running.client.server)
    environment = {**os.environ, "NO_PROXY": "*", "no_proxy": "*"}
    done = subprocess.run(
        ["bash", "-c", script],
        cwd=tmp_path,
        env=environment,
        capture_output=True,
        text=True,
        timeout=110,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert "application/problem+json" not in done.stdout


def python_block(having: str) -> str:
    blocks = re.findall(r"^```python\n(.*?)^```", README.read_text(), re.MULTILINE | re.DOTALL)
    (block,) = [block for block in blocks if having in block]
    return str(block)


def test_the_readmes_client_works(running: RunningService, design: Path, scan: Path, tmp_path: Path) -> None:
    shutil.copy(design, tmp_path / "design.stl")
    shutil.copy(scan, tmp_path / "scan.stl")
    script = python_block("from service.client.sync import").replace(DEFAULT_ADDRESS, running.client.server)
    script = script.replace("tolerance_mm=0.2", f"tolerance_mm=0.2, server={running.client.server!r}")
    done = subprocess.run(
        [sys.executable, "-c", script], cwd=tmp_path, capture_output=True, text=True, timeout=110, check=False
    )
    assert done.returncode == 0, done.stderr
    first, second = done.stdout.splitlines()
    assert first == "ok" and second.split()[1] == "ok"
    assert (tmp_path / "result" / "report.html").exists()


def test_the_readmes_webhook_receiver_works(design: Path, tmp_path: Path) -> None:
    service = RunningService(tmp_path / "data", CUSP_WEBHOOK_NETWORKS="127.0.0.0/8")
    try:
        told = subprocess.run(
            [sys.executable, "-m", "service.cli.main", "webhooks", "secret", "--data-dir", tmp_path / "data"],
            capture_output=True,
            text=True,
            check=True,
            timeout=60,
        )
        port = free_port()
        environment = {**os.environ, "CUSP_WEBHOOK_SECRET": told.stdout.strip(), "PORT": str(port)}
        with (tmp_path / "heard").open("w") as heard:
            receiver = subprocess.Popen(
                [sys.executable, "-c", python_block("HTTPServer")],
                env=environment,
                stdout=heard,
                stderr=heard,
            )
        try:
            job = service.client.landmarks(
                design, settings=QUICK["settings"], webhook={"url": f"http://127.0.0.1:{port}/"}
            )
            line = f"job.successful {job.id}"
            wait_until(lambda: line in (tmp_path / "heard").read_text(), 60, "the receiver to be told")
        finally:
            receiver.kill()
            receiver.wait()
    finally:
        service.stop()
