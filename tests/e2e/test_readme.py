"""The README's curl lines are run as they stand.

Every ```sh block that has a `curl` line is run, in order, by one shell, in a folder with design.stl and scan.stl;
only the address http://127.0.0.1:8000 is replaced by that of the service under test.
"""

import os
import re
import shutil
import subprocess
from pathlib import Path

import pytest

from tests.e2e.running import RunningService

pytestmark = pytest.mark.e2e

README = Path(__file__).parents[2] / "README.md"
DEFAULT_ADDRESS = "http://127.0.0.1:8000"


def curl_blocks(text: str) -> list[str]:
    blocks: list[str] = re.findall(r"^```sh\n(.*?)^```", text, re.MULTILINE | re.DOTALL)
    return [block for block in blocks if re.search(r"\bcurl\b", block)]


def test_the_readmes_curl_lines_work(running: RunningService, design: Path, scan: Path, tmp_path: Path) -> None:
    blocks = curl_blocks(README.read_text())
    assert blocks, "README.md has no ```sh block with curl"
    shutil.copy(design, tmp_path / "design.stl")
    shutil.copy(scan, tmp_path / "scan.stl")
    script = "set -euxo pipefail\n" + "\n".join(blocks).replace(DEFAULT_ADDRESS, running.client.server)
    environment = {**os.environ, "NO_PROXY": "*", "no_proxy": "*"}
    done = subprocess.run(
        ["bash", "-c", script], cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=110, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert "application/problem+json" not in done.stdout
