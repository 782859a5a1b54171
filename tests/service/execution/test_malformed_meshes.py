"""Meshes broken in every way: each job ends with a result or with a reason that names the mesh, and the next
job runs.

Real files of every format, bytes of which are changed, cut, doubled or replaced by numbers that break
programs; through the API's look at an upload and through the child process with the real parsers. Some of
each format in a plain run, 2,400 at night.
"""

from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

import pipeline
from pipeline import PipelineError, Settings, detect_format
from service.contract.errors import TABLE
from service.execution.job_limits import Limits
from service.execution.sandbox import Outcome, Sandbox
from tests.support.broken_meshes import CLOUDS, cases, sources
from tests.support.settings import TINY

SETTINGS = Settings.model_validate(TINY | {"report": {"write_files": False}}).model_dump(mode="json")


@pytest.fixture(scope="module")
def sandbox() -> Iterator[Sandbox]:
    made = Sandbox(Limits(time_s=60.0, memory_mib=1024))
    made.start()
    yield made
    made.stop()


def run(sandbox: Sandbox, folder: Path, ending: str, content: bytes) -> Outcome:
    folder.mkdir(parents=True)
    (folder / "mesh.mesh").write_bytes(content)
    task: dict[str, Any] = {
        "folder": str(folder),
        "out": str(folder / "out"),
        "type": "landmarks",
        "settings": SETTINGS,
        "seed": 0,
        "mesh": {"path": str(folder / "mesh.mesh"), "filename": f"part.{ending}", "unit": "auto"},
    }
    return sandbox.run(folder.name, task, lambda *_: None, lambda: True)


@pytest.mark.timeout(3600)
@pytest.mark.parametrize("count", [48, pytest.param(2400, marks=pytest.mark.nightly)])
def test_every_broken_mesh_ends_with_a_result_or_a_reason(
    sandbox: Sandbox, tmp_path: Path, count: int
) -> None:
    reasons = {vars(error)["code"] for error in TABLE if issubclass(error, PipelineError)}
    given = list(cases(count))
    with ThreadPoolExecutor(2) as pool:
        outcomes = list(
            pool.map(lambda each: run(sandbox, tmp_path / str(each[0]), *each[1]), enumerate(given))
        )
    codes = Counter("done" if each.problem is None else each.problem.code for each in outcomes)
    surprises = [
        (number, given[number][0], each.problem)
        for number, each in enumerate(outcomes)
        if each.kind != "done" and (each.problem is None or each.problem.code not in reasons)
    ]
    assert not surprises, (codes, surprises[:5])
    assert len(codes) >= 6, codes  # they are broken in many ways
    assert all(each.problem is None or each.problem.mesh == "mesh" for each in outcomes)
    whole = run(sandbox, tmp_path / "whole", "stl", sources()["stl"])
    assert whole.kind == "done", whole


@given(
    st.binary(max_size=400) | st.sampled_from(sorted(sources().values())), st.text(max_size=20) | st.none()
)
def test_a_look_at_an_upload_never_fails_but_on_purpose(head: bytes, name: str | None) -> None:
    try:
        detect_format(head[: pipeline.HEAD_BYTES], len(head), name, mesh="mesh")
    except PipelineError as refused:
        assert refused.detail


def test_the_sources_are_whole(sandbox: Sandbox, tmp_path: Path) -> None:
    """What is broken above was good before: its failures are of the changes."""
    for kind, content in sources().items():
        outcome = run(sandbox, tmp_path / kind, kind.partition("_")[0], content)
        if kind in CLOUDS:
            assert outcome.problem is not None  # points are for scans only
        else:
            assert outcome.kind == "done", (kind, outcome)
