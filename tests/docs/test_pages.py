"""README and docs: links resolve, lengths hold, commands exist."""

import json
import re
import shlex
from pathlib import Path

import pytest
import typer.main
import yaml

from service.cli.main import app
from tests.support.markdown import DOCS, README, ROOT, anchors, blocks, links, pages

MAX_README_LINES = 150
MAX_LINE = 110
EXPECTED = {
    "quickstart", "http-api", "results-and-verdicts", "settings", "cli", "python", "webhooks", "deployment",
    "operations", "security", "method", "benchmarks", "limitations", "architecture", "formats", "inspection",
}  # fmt: skip
FILES = ("acceptance.json", "design.stl", "scan.stl", "scan.ply", "scan.obj", "part.stl")


def test_the_readme_is_short() -> None:
    assert len(README.read_text().splitlines()) <= MAX_README_LINES


def test_every_page_exists_and_is_linked_from_the_readme() -> None:
    assert {path.stem for path in DOCS.glob("*.md")} == EXPECTED
    assert {f"docs/{name}.md" for name in EXPECTED} <= set(links(README))


@pytest.mark.parametrize("page", pages(), ids=lambda page: page.name)
def test_links_and_anchors_resolve(page: Path) -> None:
    for target in links(page):
        path, _, anchor = target.partition("#")
        file = (page.parent / path).resolve() if path else page
        assert file.exists(), f"{page.name}: {target}"
        assert file.is_relative_to(ROOT), f"{page.name}: {target}"
        if anchor:
            assert anchor in anchors(file), f"{page.name}: {target}"


@pytest.mark.parametrize("page", pages(), ids=lambda page: page.name)
def test_prose_has_short_lines(page: Path) -> None:
    text = re.sub(r"^```.*?^```", "", page.read_text(), flags=re.MULTILINE | re.DOTALL)
    prose = [line for line in text.splitlines() if not line.startswith(("|", "!["))]
    assert [line for line in prose if len(line) > MAX_LINE] == []


@pytest.mark.parametrize("page", pages(), ids=lambda page: page.name)
def test_json_and_yaml_examples_parse(page: Path) -> None:
    for block in blocks(page, "json"):
        json.loads(block)
    for block in blocks(page, "yaml"):
        yaml.safe_load(block)


def console_lines() -> list[tuple[str, list[str]]]:
    """(page, words) of every line of a console example."""
    found = []
    for page in pages():
        for line in "".join(blocks(page, "console")).splitlines():
            if words := shlex.split(line, comments=True):
                found.append((page.name, words))
    return found


def test_make_targets_of_examples_exist() -> None:
    targets = set(re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(), re.MULTILINE))
    told = {word for _, words in console_lines() if words[0] == "make" for word in words[1:]}
    for page in pages():
        told |= {word for span in re.findall(r"`make ([a-z -]+)`", page.read_text()) for word in span.split()}
    assert told
    assert told <= targets


def test_cusp_lines_of_examples_are_valid_command_lines(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The real command line parses each: commands, options, choices and files are checked, nothing runs."""
    monkeypatch.chdir(tmp_path)
    for name in FILES:
        (tmp_path / name).touch()
    lines = [(page, words[1:]) for page, words in console_lines() if words[0] == "cusp"]
    assert len(lines) > 10
    for page, words in lines:
        command, name, rest = typer.main.get_command(app), "cusp", list(words)
        while commands := getattr(command, "commands", None):
            name = rest.pop(0)
            assert name in commands, f"{page}: cusp {' '.join(words)}"
            command = commands[name]
        command.make_context(name, rest)
