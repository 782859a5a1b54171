"""`cusp segment`, `cusp landmarks` and `cusp study`, in this process: no server, no port."""

import json
from pathlib import Path

import pytest
from click.testing import Result
from typer.testing import CliRunner

from pipeline import LandmarksResult, SegmentsResult, StudyResult
from service.cli.main import app
from tests.support.meshes import blob_stl
from tests.support.settings import FAST

FEW_TRIALS = ("--trials", 20, "--detectors", "t2,iss", "--detectors", "random")


@pytest.fixture(scope="module")
def blob(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("mesh") / "blob.stl"
    path.write_bytes(blob_stl())
    return path


@pytest.fixture(scope="module")
def quick(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("settings") / "quick.json"
    settings = {**FAST, "segmentation": {"n_centres": 9}, "landmarks": {"count": 7}}
    path.write_text(json.dumps(settings))
    return path


def cusp(*arguments: object) -> Result:
    return CliRunner().invoke(app, list(map(str, arguments)), env={"COLUMNS": "160"})


def done(*arguments: object) -> str:
    """Standard output of a command that went well."""
    result = cusp(*arguments)
    assert result.exit_code == 0, result.output
    return result.stdout


# --- segment


def test_segment_writes_the_files_and_says_what_it_found(blob: Path, quick: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    told = done(
        *("segment", blob, "--method", "kmeans", "--n-centres", 4, "--unit", "cm"),
        *("--out", out, "--settings", quick),
    )
    assert "segments: 4 by kmeans" in told
    assert "d_c: " in told and "halo: 0.0%" in told and "files: " in told
    result = SegmentsResult.model_validate_json((out / "results.json").read_text())
    assert sorted(path.name for path in out.iterdir()) == result.files
    assert result.provenance.inputs.mesh.mm_per_unit == 10.0


def test_segment_as_json_is_the_results_and_the_settings_file_counts(
    blob: Path, quick: Path, tmp_path: Path
) -> None:
    told = done("segment", blob, "--out", tmp_path, "--settings", quick, "--json")
    assert SegmentsResult.model_validate_json(told).segments.mesh.count == 9


# --- landmarks


def test_landmarks_writes_the_files_and_says_how_many_are_where(
    blob: Path, quick: Path, tmp_path: Path
) -> None:
    out = tmp_path / "out"
    told = done("landmarks", blob, "--out", out, "--settings", quick, "--unit", "cm", "--count", 3)
    result = LandmarksResult.model_validate_json((out / "results.json").read_text())
    found = len(result.landmarks.mesh)
    assert 0 < found <= 3  # the option, over the file's 7
    assert f"landmarks: {found} by t2, in 9 segments" in told
    assert sorted(path.name for path in out.iterdir()) == result.files
    assert set(result.files) >= {"landmarks.csv", "mesh.clean.ply", "mesh.vertices.csv", "mesh.segments.ply"}
    assert result.provenance.inputs.mesh.mm_per_unit == 10.0
    rows = [line.split() for line in told.splitlines() if line[:1].isdigit()]
    assert len(rows) == 9
    assert sum(int(row[2]) for row in rows) == found


def test_landmarks_as_json_is_the_results_of_the_detector_asked(
    blob: Path, quick: Path, tmp_path: Path
) -> None:
    told = done("landmarks", blob, "--detector", "farthest", "--out", tmp_path, "--settings", quick, "--json")
    result = LandmarksResult.model_validate_json(told)
    assert result.provenance.settings["landmarks"]["detector"] == "farthest"
    assert len(result.landmarks.mesh) == 7


# --- study


def test_study_writes_the_files_and_prints_a_row_a_detector(blob: Path, quick: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    told = done(
        *("study", blob, *FEW_TRIALS, "--out", out, "--settings", quick, "--noise-mm", 1.5),
        *("--rotation-deg", 10, "--count", 6),
    )
    assert "study: informativeness, 20 trials" in told
    result = StudyResult.model_validate_json((out / "results.json").read_text())
    assert (
        sorted(path.name for path in out.iterdir())
        == result.files
        == ["report.html", "results.json", "study.svg", "trials.csv"]
    )
    assert result.protocol.kind == "informativeness"
    assert (result.protocol.noise_mm, result.protocol.rotation_deg, result.protocol.count) == (1.5, 10, 6)
    assert result.informativeness is not None
    assert {row.detector for row in result.informativeness} == {"t2", "iss", "random"}
    for row in result.informativeness:
        assert any(line.startswith(f"{row.detector} ") and row.icp in line for line in told.splitlines())
    assert " ".join(result.summary.split()) in " ".join(told.split())


def test_study_as_json_is_the_results_of_the_kind_asked(blob: Path, quick: Path, tmp_path: Path) -> None:
    told = done(
        *(
            "study",
            blob,
            "--kind",
            "repeatability",
            "--trials",
            1,
            "--detectors",
            "t2, random",
            "--eps",
            0.02,
        ),
        *("--out", tmp_path, "--settings", quick, "--json"),
    )
    result = StudyResult.model_validate_json(told)
    assert result.protocol.kind == "repeatability"
    assert result.protocol.eps == 0.02
    assert result.repeatability is not None
    assert {row.detector for row in result.repeatability} == {"t2", "random"}


# --- bad input


@pytest.mark.parametrize(
    ("command", "arguments", "words"),
    [
        ("segment", ("--method", "voodoo"), "options.settings.segmentation.method"),
        ("segment", ("--n-centres", 0), "options.settings.segmentation.n_centres"),
        ("segment", ("--unit", "ell"), "options.units.mesh: must be 'auto', 'mm'"),
        ("segment", ("--preset", "best"), "options.preset"),
        ("landmarks", ("--detector", "voodoo"), "options.settings.landmarks.detector"),
        ("landmarks", ("--count", 0), "options.settings.landmarks.count"),
        ("landmarks", ("--unit", "ell"), "options.units.mesh"),
        ("study", ("--kind", "guess"), "options.settings.study.kind"),
        ("study", ("--trials", 0), "options.settings.study.trials"),
        ("study", ("--detectors", "t2,voodoo"), "options.settings.study.detectors.1"),
        ("study", ("--eps", 1), "options.settings.study.eps"),
        ("study", ("--preset", "best"), "options.preset"),
    ],
)
def test_a_wrong_option_is_one_sentence_and_exit_code_1(
    command: str, arguments: tuple[object, ...], words: str, blob: Path
) -> None:
    result = cusp(command, blob, *arguments)
    assert result.exit_code == 1
    assert words in result.stderr and result.stderr.count("\n") == 1


@pytest.mark.parametrize("command", ["segment", "landmarks", "study"])
def test_a_bad_mesh_is_one_sentence_and_exit_code_1(command: str, tmp_path: Path) -> None:
    empty = tmp_path / "empty.stl"
    empty.touch()
    result = cusp(command, empty, "--out", tmp_path / "out")
    assert result.exit_code == 1
    assert "mesh: the file is empty" in result.stderr


def test_a_settings_file_that_is_not_json_is_named(blob: Path, tmp_path: Path) -> None:
    path = tmp_path / "settings.json"
    path.write_text("{landmarks")
    result = cusp("landmarks", blob, "--settings", path)
    assert result.exit_code == 1
    assert "settings.json: not JSON" in result.stderr
