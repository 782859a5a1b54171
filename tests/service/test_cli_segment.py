"""`cusp segment`, in this process: no server, no port."""

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from pipeline import SegmentsResult
from service.cli import app
from tests.service.meshes import blob_stl


@pytest.fixture(scope="module")
def blob(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("mesh") / "blob.stl"
    path.write_bytes(blob_stl())
    return path


@pytest.fixture(scope="module")
def quick(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("settings") / "quick.json"
    path.write_text(json.dumps({"resample": {"target_vertices": 400}, "segmentation": {"n_centres": 9}}))
    return path


def test_it_writes_the_files_and_says_what_it_found(blob: Path, quick: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    arguments = ["segment", str(blob), "--method", "kmeans", "--n-centres", "4", "--unit", "cm"]
    done = CliRunner().invoke(app, [*arguments, "--out", str(out), "--settings", str(quick)])
    assert done.exit_code == 0, done.output
    assert "segments: 4 by kmeans" in done.stdout
    assert "d_c: " in done.stdout and "halo: 0.0%" in done.stdout and "files: " in done.stdout
    result = SegmentsResult.model_validate_json((out / "results.json").read_text())
    assert sorted(path.name for path in out.iterdir()) == result.files
    assert result.provenance.inputs.mesh.mm_per_unit == 10.0


def test_json_is_the_results_and_the_settings_file_counts(blob: Path, quick: Path, tmp_path: Path) -> None:
    arguments = ["segment", str(blob), "--out", str(tmp_path), "--settings", str(quick), "--json"]
    done = CliRunner().invoke(app, arguments)
    assert done.exit_code == 0, done.output
    assert SegmentsResult.model_validate_json(done.stdout).segments.mesh.count == 9


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--method", "voodoo"], "segmentation.method"),
        (["--n-centres", "0"], "segmentation.n_centres"),
        (["--unit", "ell"], "--unit ell: must be one of auto, mm"),
        (["--preset", "best"], "preset"),
    ],
)
def test_a_wrong_option_is_one_sentence_and_exit_code_1(arguments: list[str], words: str, blob: Path) -> None:
    done = CliRunner().invoke(app, ["segment", str(blob), *arguments])
    assert done.exit_code == 1
    assert words in done.stderr and done.stderr.count("\n") == 1


def test_a_bad_mesh_is_one_sentence_and_exit_code_1(tmp_path: Path) -> None:
    empty = tmp_path / "empty.stl"
    empty.touch()
    done = CliRunner().invoke(app, ["segment", str(empty), "--out", str(tmp_path / "out")])
    assert done.exit_code == 1
    assert "mesh: the file is empty" in done.stderr
