"""The `cusp` command, as a person types it."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

import pipeline
from tests.support.running import QUICK, RunningService

pytestmark = pytest.mark.e2e


def cusp(*arguments: object, **environment: str) -> "subprocess.CompletedProcess[str]":
    command = [sys.executable, "-m", "service.cli.main", *map(str, arguments)]
    return subprocess.run(
        command, capture_output=True, text=True, timeout=300, check=False, env={**os.environ, **environment}
    )


def contents(path: Path) -> bytes:
    """Of a report without the date and the job at its head and in its title, which only the service knows."""
    told = rb"<div><span>(date|job)</span><b>[^<]*</b></div>| \xc2\xb7 [0-9-]{10} [0-9:]{5} UTC(?=</title>)"
    return re.sub(told, b"", path.read_bytes())


@pytest.fixture(scope="module")
def quick(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("settings") / "quick.json"
    path.write_text(json.dumps(QUICK["settings"]))
    return path


def test_register_needs_no_server_and_writes_what_the_service_writes(
    running: RunningService, design: Path, scan: Path, quick: Path, tmp_path: Path
) -> None:
    stated = ("--settings", quick, "--tolerance-mm", 0.5, "--scan-accuracy-mm", 0.02)
    here = cusp("register", design, scan, "--out", tmp_path / "here", *stated)
    assert here.returncode == 0, here.stderr
    assert "alignment: ok" in here.stdout
    there = cusp(
        *("submit", design, scan, "--server", running.client.server, "--wait", "--json"),
        *("--out", tmp_path / "there", *stated),
    )
    assert there.returncode == 0, there.stderr
    result = pipeline.RegistrationResult.model_validate_json(there.stdout)
    assert result.scan is not None and result.scan.accuracy_mm == 0.02
    names = {path.name for path in (tmp_path / "here").iterdir()}
    assert names == {path.name for path in (tmp_path / "there").iterdir()}
    for name in names - {"results.json"}:  # which has timings
        assert contents(tmp_path / "here" / name) == contents(tmp_path / "there" / name), name


@pytest.mark.nightly
def test_landmarks_needs_no_server_and_writes_what_the_service_writes(
    running: RunningService, design: Path, quick: Path, tmp_path: Path
) -> None:
    here = cusp("landmarks", design, "--out", tmp_path / "here", "--settings", quick)
    assert here.returncode == 0, here.stderr
    there = cusp(
        *("submit", design, "--type", "landmarks", "--server", running.client.server),
        *("--out", tmp_path / "there", "--settings", quick),
    )
    assert there.returncode == 0, there.stderr
    assert here.stdout.replace("/here", "/there") == there.stdout
    names = {path.name for path in (tmp_path / "here").iterdir()}
    assert names == {path.name for path in (tmp_path / "there").iterdir()}
    for name in names - {"results.json"}:  # which has timings
        assert contents(tmp_path / "here" / name) == contents(tmp_path / "there" / name), name


def test_submit_counts_its_meshes(design: Path) -> None:
    done = cusp("submit", design)
    assert (
        done.returncode,
        "a registration job takes 2 file(s) (design and scan), not 1" in done.stderr,
    ) == (1, True)
    done = cusp("submit", design, design, "--type", "study")
    assert (done.returncode, "a study job takes 1 file(s) (mesh), not 2" in done.stderr) == (1, True)
    done = cusp("submit", design, "--type", "guess")
    assert (done.returncode, "type 'guess'" in done.stderr) == (1, True)


def test_bad_input_is_one_clear_sentence_and_exit_code_1(design: Path, tmp_path: Path) -> None:
    empty = tmp_path / "empty.stl"
    empty.touch()
    done = cusp("register", design, empty, "--out", tmp_path / "out")
    assert done.returncode == 1
    assert "scan: the file is empty" in done.stderr
    assert "Traceback" not in done.stderr
    done = cusp("register", design, design, "--out", tmp_path / "out", "--unit-scan", "ell")
    assert (done.returncode, "options.units.scan" in done.stderr) == (1, True)
    done = cusp("submit", design, design, "--server", "http://127.0.0.1:9")
    assert (done.returncode, "cusp up" in done.stderr) == (1, True)


def test_up_refuses_what_would_be_unsafe(running: RunningService, tmp_path: Path) -> None:
    open_host = cusp("up", "--host", "0.0.0.0", "--data-dir", tmp_path)  # noqa: S104
    assert open_host.returncode == 1
    assert "--allow-open" in open_host.stderr
    same_folder = cusp("up", "--port", 0, "--data-dir", running.data_dir)
    assert same_folder.returncode == 1
    assert "another cusp uses" in same_folder.stderr
