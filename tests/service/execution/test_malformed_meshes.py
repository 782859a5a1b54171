"""Meshes broken in every way: each job ends with a result or with a reason that names the mesh, and the next job runs.

Real files of every format, bytes of which are changed, cut, doubled or replaced by numbers that break programs; through
the API's look at an upload and through the child process with the real parsers. 200 in a plain run, `CUSP_TEST_NIGHTLY=1`
2,400.
"""

import os
import random
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st

import pipeline
from pipeline import PipelineError, Settings, detect_format
from service.contract.errors import TABLE
from service.execution.sandbox import Limits, Outcome, Sandbox
from tests.support.shapes import icosphere

COUNT = 2400 if os.environ.get("CUSP_TEST_NIGHTLY") else 200
FORMATS = ("stl", "stl_ascii", "ply", "ply_ascii", "obj", "off", "3mf", "glb", "xyz")
EVIL_WORDS = [
    b"nan",
    b"inf",
    b"-inf",
    b"1e308",
    b"1e999",
    b"-1",
    b"99999999999",
    b"4294967295",
    b"0",
    b"",
    b"\xff\xfe",
    b"1e-320",
]
EVIL_BYTES = [b"\x00" * 4, b"\xff" * 4, b"\xff\xff\xff\x7f", b"\x00\x00\xc0\x7f", b"\x00\x00\x80\x7f"]
SMALL = {
    "resample": {"target_vertices": 200},
    "features": {"target_vertices": 200},
    "report": {"write_files": False},
}


def sources() -> dict[str, bytes]:
    """A small closed mesh in each format."""
    shape = icosphere(10.0, 1)
    mesh = trimesh.Trimesh(shape.vertices * [1.0, 0.8, 0.6], shape.faces, process=False)
    made: dict[str, bytes] = {}
    for kind in FORMATS:
        name, _, is_ascii = kind.partition("_")
        if kind == "xyz":
            made[kind] = "\n".join(" ".join(f"{x:.4f}" for x in point) for point in mesh.vertices).encode()
        elif name == "ply":
            made[kind] = trimesh.exchange.ply.export_ply(mesh, encoding="ascii" if is_ascii else "binary")
        else:
            content = mesh.export(file_type=kind)
            made[kind] = content.encode() if isinstance(content, str) else content
    return made


def mutated(content: bytes, draw: random.Random) -> bytes:
    """One to four changes."""
    for _ in range(draw.randint(1, 4)):
        content = changed(content, draw) or b"\n"
    return content


def changed(content: bytes, draw: random.Random) -> bytes:
    """One change."""
    at, to = sorted((draw.randrange(len(content) + 1), draw.randrange(len(content) + 1)))
    to = min(to, at + 400)
    evil, word = draw.choice(EVIL_BYTES), draw.choice(EVIL_WORDS)
    match draw.randrange(9):
        case 0:
            return content[:at]
        case 1:
            return content[:at] + content[to:]
        case 2:
            return content[:to] + content[at:]
        case 3:
            return content[:at] + draw.randbytes(to - at) + content[to:]
        case 4:
            return content[:at] + evil + content[at + 4 :]
        case 5:  # in the header
            return content[: at % 200] + evil + content[at % 200 + 4 :]
        case 6:
            return b" ".join(word if draw.random() < 0.02 else each for each in content.split(b" "))
        case 7:
            return content.replace(str(draw.randrange(10)).encode(), word, 3)
        case _:
            return content.replace(b"\n", draw.choice([b"\r", b"\r\n", b" ", b"\n\n\n"]))


def cases() -> Iterator[tuple[str, bytes]]:
    made = sources()
    for number in range(COUNT):
        draw = random.Random(number)
        kind = FORMATS[number % len(FORMATS)]
        yield kind.partition("_")[0], mutated(made[kind], draw)


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
        "settings": Settings.model_validate(SMALL).model_dump(mode="json"),
        "seed": 0,
        "mesh": {"path": str(folder / "mesh.mesh"), "filename": f"part.{ending}", "unit": "auto"},
    }
    return sandbox.run(folder.name, task, lambda *_: None, lambda: True)


@pytest.mark.timeout(3600)
def test_every_broken_mesh_ends_with_a_result_or_a_reason(sandbox: Sandbox, tmp_path: Path) -> None:
    reasons = {vars(error)["code"] for error in TABLE if issubclass(error, PipelineError)}
    given = list(cases())
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
        if kind == "xyz":
            assert outcome.problem is not None  # points are for scans only
        else:
            assert outcome.kind == "done", (kind, outcome)
