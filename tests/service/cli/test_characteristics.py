"""`cusp characteristics`, against a service in this process."""

import json
from pathlib import Path

from click.testing import Result
from typer.testing import CliRunner

from service.cli.main import app
from tests.support.service import TRIANGLE_OBJ, Service


def test_what_is_kept_is_put_read_changed_and_forgotten(service: Service, tmp_path: Path) -> None:
    design, drawing = tmp_path / "design.obj", tmp_path / "drawing.json"
    design.write_bytes(TRIANGLE_OBJ)

    def run(*arguments: object) -> Result:
        server = ("--server", str(service.http.base_url))
        return CliRunner().invoke(app, ["characteristics", *map(str, arguments), *server])

    def said(*arguments: object) -> str:
        done = run(*arguments)
        assert done.exit_code == 0, done.output
        return "\n".join(line for line in done.stdout.splitlines() if not line.startswith("["))

    drawing.write_text('{"tolerance_mm": 0.2}')
    blob, version = said("put", design, drawing, "--only-new").split()
    assert said("version", design).strip() == said("version", blob).strip() == version
    drawing.write_text('{"tolerance_mm": 0.3}')
    assert "is there already" in run("put", blob, drawing, "--only-new").output
    assert said("put", blob, drawing, "--if-version", version).split()[0] == blob
    assert "another version" in run("put", blob, drawing, "--if-version", version).output
    assert json.loads(said("get", design))["tolerance_mm"] == 0.3
    said("delete", design)
    for wrong, words in (
        (("get", design), "has no characteristics"),
        (("get", "sha256"), "no such file"),
        (("put", blob, drawing, "--only-new", "--if-version", "x"), "contradict"),
        (("put", blob, design), "not JSON"),
    ):
        done = run(*wrong)
        assert (done.exit_code, words in done.output) == (1, True), done.output
    drawing.write_text('{"acceptance": {"min_within": 0.9}}')
    assert "min_within needs" in run("put", blob, drawing).output
