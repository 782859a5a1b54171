"""What a person and a script see of a verdict: words, exit codes, the page."""

import io
import json
import re
from pathlib import Path
from typing import Any, get_args

import pytest
import typer
from rich.console import Console
from typer.testing import CliRunner

import pipeline
from pipeline import RegistrationResult
from service.cli import jobs
from service.cli.jobs import EXITS
from service.cli.main import app
from service.client.results_table import print_results
from tests.support.meshes import blob_stl
from tests.support.settings import FAST

ROOT = Path(__file__).parents[3]
WORDS = ROOT / "service" / "web" / "words.js"
STATUSES = get_args(pipeline.core.results.VerdictStatus)
RESULTS = json.loads((ROOT / "openapi" / "examples" / "results.registration.json").read_text())


def printed(**verdict: Any) -> str:
    """The summary of a result with this verdict."""
    text = io.StringIO()
    print_results(RESULTS | {"verdict": RESULTS["verdict"] | verdict}, None, Console(file=text, width=160))
    return text.getvalue().splitlines()[0]


def test_every_status_has_an_exit_code_of_its_own() -> None:
    assert set(EXITS) == set(STATUSES)
    assert sorted(EXITS.values()) == [0, 3, 4, 5, 6, 7, 8] and EXITS["uncertain"] == 8


def test_every_status_has_words_on_the_page() -> None:
    meaning = re.search(r"MEANING = \{(.*?)\n\};", WORDS.read_text(), re.DOTALL)
    mood = re.search(r"MOOD = \{(.*?)\};", WORDS.read_text())
    assert meaning is not None and mood is not None
    assert set(re.findall(r"^  (\w+):", meaning[1], re.MULTILINE)) == set(STATUSES)
    assert set(re.findall(r"(\w+): 'warn'", mood[1])) == set(STATUSES) - {"ok", "mirrored", "no_match"}


@pytest.mark.parametrize("status", STATUSES)
def test_the_summary_says_that_the_status_is_of_the_alignment(status: str) -> None:
    assert printed(status=status).startswith(f"alignment: {status} (")


def test_the_summary_gives_both_probabilities_or_says_that_there_are_none() -> None:
    given = {"confidence": 0.891, "same_part": 0.99, "pose": 0.9}
    assert printed(**given).endswith("(confidence 0.89: same part 0.99, pose 0.90)")
    assert printed(confidence=None, same_part=None, pose=None).endswith("(confidence not given)")
    assert printed(confidence=0.5, same_part=None, pose=None).endswith("(confidence 0.50)")  # earlier results


def test_register_takes_the_accuracy_of_the_scanner(tmp_path: Path) -> None:
    meshes = [tmp_path / "design.stl", tmp_path / "scan.stl"]
    meshes[0].write_bytes(blob_stl())
    meshes[1].write_bytes(blob_stl(23, 37, turn_deg=25.0, shift_mm=(4.0, -3.0, 2.0)))
    (tmp_path / "quick.json").write_text(json.dumps(FAST))
    command = ["register", *meshes, "--out", tmp_path / "out", "--settings", tmp_path / "quick.json"]
    words = [str(each) for each in command]
    done = CliRunner().invoke(app, [*words, "--scan-accuracy-mm", "0.03"], env={"COLUMNS": "160"})
    assert done.exit_code == 0, done.output
    assert "alignment: ok (confidence " in done.stdout
    result = RegistrationResult.model_validate_json((tmp_path / "out" / "results.json").read_text())
    assert result.scan is not None and result.scan.accuracy_mm == 0.03
    refused = CliRunner().invoke(app, [*words, "--scan-accuracy-mm", "0"])
    assert (refused.exit_code, "options.scan_accuracy_mm" in refused.stderr) == (1, True)


@pytest.mark.parametrize(
    ("status", "decision", "code"),
    [
        ("ok", "pass", 0),
        ("ok", "not_judged", 0),
        ("ok", "fail", 9),
        ("uncertain", "fail", 9),
        ("uncertain", "not_judged", 8),
    ],
)
def test_a_part_that_fails_has_an_exit_code_of_its_own(status: str, decision: str, code: int) -> None:
    results = RESULTS | {
        "verdict": RESULTS["verdict"] | {"status": status},
        "inspection": RESULTS["inspection"] | {"decision": decision},
    }
    with pytest.raises(typer.Exit) as ended:
        jobs._conclude(results, None, as_json=True)
    assert ended.value.exit_code == code


def test_the_summary_gives_the_decision_and_every_check() -> None:
    text = io.StringIO()
    print_results(RESULTS, None, Console(file=text, width=160))
    assert "part: pass\n" in text.getvalue()
    for check in RESULTS["inspection"]["checks"]:
        assert check["name"] in text.getvalue()
    print_results(RESULTS | {"inspection": None}, None, Console(file=io.StringIO()))  # of an earlier version


def test_an_uncertain_alignment_ends_with_its_exit_code() -> None:
    verdict = RESULTS["verdict"] | {"status": "uncertain"}
    with pytest.raises(typer.Exit) as ended:
        jobs._conclude(RESULTS | {"verdict": verdict}, None, as_json=True)
    assert ended.value.exit_code == 8
