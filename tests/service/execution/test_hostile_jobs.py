"""Code of an attacker in a job's process: nothing beside its own folder is reached, and the neighbour
finishes.
"""

import json
import os
import socket
import sqlite3
import threading
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from unittest.mock import ANY

import pytest

from service.execution.confinement.measures import available
from service.execution.folder_removal import remove_folder
from service.execution.job_limits import Limits
from service.execution.sandbox import Outcome, Sandbox
from tests.service.execution.misbehaving.hostile import ATTEMPTS

pytestmark = pytest.mark.skipif(bool(available().missing), reason=f"this kernel: {available().missing}")
#: Attempts that the zygote or the worker ends, and the code of the job then; the kernel refuses all others.
PROCESSES = ["start a program", "fork 10,000 times"]
APART = ["take a name that is no text", "start 900 threads in a second process"]  # tests of their own
LIMIT_S = 120.0
ENDED = {
    "fill the disk": "job_out_of_disk",
    "fill the disk with deleted files": "job_out_of_disk",
    "fill the disk with mapped files": "job_out_of_disk",
    "fill the disk below any path": "job_out_of_disk",
    "make a million files": "job_out_of_disk",
    "nest 5,000 folders": "job_out_of_disk",
    "end its first thread": "job_crashed",
    "leave sparse files": "job_out_of_disk",
    "share memory with itself": "job_out_of_memory",
    "fill the disk in a locked folder": "job_out_of_disk",
}


@dataclass
class Scene:
    """A sandbox with one good job that runs until `finish`, beside data that belongs to others."""

    sandbox: Sandbox
    folder: Path
    task: dict[str, Any]
    outcomes: list[Outcome] = field(default_factory=list)

    def attempt(self, *names: str, **more: Any) -> tuple[Outcome, dict[str, str]]:
        """How the job ended, and what happened to each attempt; the neighbour runs on."""
        own = self.folder / f"{len(list(self.folder.iterdir()))}"
        own.mkdir()
        task = {**self.task, "folder": str(own), "out": str(own / "out"), "attempts": names, **more}
        outcome = self.sandbox.run(own.name, task, lambda *_: None, lambda: True)
        assert self.outcomes == []
        happened = own / "happened"
        return outcome, json.loads(happened.read_text()) if happened.exists() else {}


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Scene]:
    folder = tmp_path_factory.mktemp("data")
    (folder / "blobs").mkdir()
    (folder / "blobs" / "blob").write_text("mesh of another tenant")
    with sqlite3.connect(folder / "cusp.db") as database:
        database.execute("CREATE TABLE jobs (id TEXT)")
    database.close()
    with pytest.MonkeyPatch.context() as patch, socket.create_server(("127.0.0.1", 0)) as server:
        patch.setenv("PYTHONPATH", str(Path(__file__).parent / "misbehaving"))
        sandbox = Sandbox(Limits(LIMIT_S, 300, 64), target="any_of_them")
        good = folder / "scratch" / "good"
        good.mkdir(parents=True)
        outcomes: list[Outcome] = []
        task = {"folder": str(good), "misbehave": "slow"}
        thread = threading.Thread(
            target=lambda: outcomes.append(sandbox.run("good", task, lambda *_: None, lambda: True))
        )
        thread.start()
        while not (good / "child.log").exists():
            time.sleep(0.01)
        assert sandbox._link is not None
        neighbour = sandbox._link._runs["good"].pid
        yield Scene(
            sandbox,
            folder / "scratch",
            {
                "misbehave": "hostile",
                "blob": str(folder / "blobs" / "blob"),
                "database": str(folder / "cusp.db"),
                "sibling": str(good),
                "port": server.getsockname()[1],
                "worker": os.getpid(),
                "neighbour": neighbour,
            },
            outcomes,
        )
        assert outcomes == []
        (good / "go").touch()
        thread.join(60)
        assert [outcome.kind for outcome in outcomes] == ["done"]  # the neighbour finishes
        sandbox.stop()
        remove_folder(folder / "scratch")  # before pytest, which cannot


@pytest.mark.parametrize("with_processes", [False, True])
def test_the_kernel_refuses_every_attempt(scene: Scene, with_processes: bool) -> None:
    """with_processes : as a job that reads a STEP, by a second process"""
    names = [name for name in ATTEMPTS if name not in (*ENDED, *PROCESSES, *APART)]
    names += [] if with_processes else PROCESSES
    outcome, happened = scene.attempt(*names, with_processes=with_processes)
    assert outcome.kind == "done"
    assert list(happened) == names
    assert [name for name, what in happened.items() if what == "allowed"] == []


@pytest.mark.parametrize("name", ENDED)
def test_the_service_ends_what_the_kernel_does_not_refuse(scene: Scene, name: str) -> None:
    outcome, happened = scene.attempt(name)
    assert outcome.problem is not None and outcome.problem.code == ENDED[name], happened
    assert outcome.seconds < LIMIT_S


def test_a_folder_that_no_path_reaches_is_removed(scene: Scene) -> None:
    """Deeper than a recursion or a path can follow, and of other jobs here without rights."""
    scene.attempt("nest 5,000 folders")
    for folder in sorted(scene.folder.iterdir()):
        if folder.name != "good":
            remove_folder(folder)
    assert [folder.name for folder in scene.folder.iterdir()] == ["good"]


def test_a_name_that_is_no_text_ends_nobody(scene: Scene) -> None:
    assert scene.attempt(APART[0]) == (ANY, {APART[0]: "allowed"})


def test_threads_of_a_second_process_count(scene: Scene) -> None:
    outcome, _ = scene.attempt(APART[1], with_processes=True)
    assert outcome.problem is not None and outcome.problem.code in ("job_crashed", "job_out_of_memory")


def test_a_fork_bomb_of_a_job_that_may_start_processes_is_ended(scene: Scene) -> None:
    assert scene.attempt("start a program", with_processes=True)[1] == {"start a program": "allowed"}
    outcome, _ = scene.attempt("fork 10,000 times", with_processes=True)
    # The memory of the copies counts too: either limit may be reached first.
    assert outcome.problem is not None and outcome.problem.code in ("job_crashed", "job_out_of_memory")
