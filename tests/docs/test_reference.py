"""The reference tables of the documentation are what the code says."""

import ast
from pathlib import Path
from typing import Any

import typer.main

import pipeline
import service.client
from docs.generate import pages
from pipeline import PipelineError, Stage
from service.cli.main import app
from service.contract.errors import TABLE
from service.contract.schemas import Options, Status
from service.jobs.metrics import COUNTERS
from tests.support.markdown import DOCS, ROOT, rows, section

RESULTS = DOCS / "results-and-verdicts.md"
NOT_MENTIONED = {"--help"}


def test_generated_parts_are_up_to_date() -> None:
    for path, text in pages().items():
        assert path.read_text() == text, f"{path.name} is out of date: run `make docs`"


def codes_of(record: str) -> set[str]:
    """Every constant `code` that the source of the pipeline gives to a record of this name."""
    found = set()
    for path in (ROOT / "pipeline").rglob("*.py"):
        for call in ast.walk(ast.parse(path.read_text())):
            if isinstance(call, ast.Call) and isinstance(call.func, ast.Name) and call.func.id == record:
                found |= {
                    str(word.value.value)
                    for word in call.keywords
                    if word.arg == "code" and isinstance(word.value, ast.Constant)
                }
    return found


def test_every_finding_code_is_explained() -> None:
    found = codes_of("Finding")
    assert len(found) > 10
    assert {row[0] for row in rows(section(RESULTS, "Findings"))} == found


def test_every_warning_code_is_explained() -> None:
    found = codes_of("Note") | codes_of("Reason")  # of what a reader left out
    assert len(found) > 5
    assert {row[0] for row in rows(section(RESULTS, "Warnings"))} == found


def test_every_error_code_is_explained_with_its_status() -> None:
    told = {row[0]: int(row[1]) for row in rows(section(RESULTS, "Error codes"))}
    # The base class of errors about meshes is never raised itself.
    made = {
        str(vars(error)["code"]): row.status for error, row in TABLE.items() if error is not PipelineError
    }
    assert told == made


def test_every_status_verdict_and_stage_is_explained() -> None:
    api = (DOCS / "http-api.md").read_text()
    assert {row[0] for row in rows(section(DOCS / "http-api.md", "Status and polling"))} == set(Status)
    assert {row[0] for row in rows(section(DOCS / "http-api.md", "Options"))} == set(Options.model_fields)
    assert all(f"`{stage.value}`" in api for stage in Stage)
    verdicts = pipeline.core.results.Verdict.model_fields["status"].annotation
    assert {row[0] for row in rows(section(RESULTS, "Verdict"))} == set(verdicts.__args__)  # type: ignore[union-attr]


def test_every_address_of_the_api_is_listed() -> None:
    import json

    text = (DOCS / "http-api.md").read_text()
    document = json.loads((ROOT / "openapi/openapi.json").read_text())
    for path, methods in document["paths"].items():
        plain = path.replace("{job_id}", "{id}").replace("{blob_id}", "{id}")
        for method in methods:
            assert f"{method.upper()} {plain}" in text, f"{method.upper()} {path}"


def test_every_metric_is_listed() -> None:
    told = {row[0].removesuffix("_total") for row in rows(section(DOCS / "operations.md", "Metrics"))}
    source = (ROOT / "service/jobs/metrics.py").read_text()
    gauges = {
        str(node.value)
        for node in ast.walk(ast.parse(source))
        if isinstance(node, ast.Constant) and str(node.value).startswith("cusp_")
    }
    assert told == gauges | set(COUNTERS)


def test_every_command_and_flag_is_listed() -> None:
    text = (DOCS / "cli.md").read_text()

    def visit(command: Any, path: str) -> None:
        for parameter in command.params:
            for flag in parameter.opts:
                if flag.startswith("--") and flag not in NOT_MENTIONED:
                    assert f"`{flag}`" in text, f"{path} {flag}"
        for name, below in getattr(command, "commands", {}).items():
            if not getattr(below, "commands", None):
                assert f"{path} {name}" in text
            visit(below, f"{path} {name}")

    visit(typer.main.get_command(app), "cusp")


def test_every_public_name_is_listed() -> None:
    text = (DOCS / "python.md").read_text()
    for name in (*pipeline.__all__, *service.client.__all__):
        assert f"`{name}" in text, name


def test_every_table_of_the_database_is_listed() -> None:
    names = {
        line.split('"')[1]
        for path in Path(ROOT / "service").rglob("*.py")
        for line in path.read_text().splitlines()
        if "__tablename__ = " in line
    }
    assert {row[0] for row in rows(section(DOCS / "architecture.md", "Tables"))} == names
