"""However a job's process ends, it is that job's outcome, and the next job runs."""

import json
import os
import select
import signal
import subprocess
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from service.execution.job_limits import Limits
from service.execution.progress_pipe import MAX_LINES
from service.execution.sandbox import READ_INTERVAL_S, Outcome, Sandbox, SandboxError

MISBEHAVING = Path(__file__).parent / "misbehaving"
Make = Callable[..., Sandbox]


@pytest.fixture
def make(monkeypatch: pytest.MonkeyPatch) -> Iterator[Make]:
    """Sandboxes whose children run a module of `misbehaving/`."""
    monkeypatch.setenv("PYTHONPATH", str(MISBEHAVING))
    made: list[Sandbox] = []

    def make_one(target: str, time_s: float = 30.0, memory_mib: int = 300, disk_mib: int = 4096) -> Sandbox:
        made.append(Sandbox(Limits(time_s, memory_mib, disk_mib), target=target))
        return made[-1]

    yield make_one
    for sandbox in made:
        sandbox.stop()


def run(
    sandbox: Sandbox, folder: Path, *, wanted: Callable[[], bool] = lambda: True, **task: object
) -> Outcome:
    return sandbox.run(
        folder.name, {"folder": str(folder), "out": str(folder / "out"), **task}, lambda *_: None, wanted
    )


def is_alive(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def wait_until(condition: Callable[[], bool], seconds: float = 60.0) -> None:
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline, "waited in vain"
        time.sleep(0.01)


@pytest.mark.parametrize(
    ("target", "code", "words"),
    [
        ("segfault", "job_crashed", "SIGSEGV"),
        ("exits", "job_crashed", "code 7"),
        ("raises", "job_crashed", "ZeroDivisionError"),
        ("memory_hog", "job_out_of_memory", "300 MiB"),
        ("giant_allocation", "job_out_of_memory", "300 MiB"),
        ("fills_the_disk", "job_crashed", "OSError"),
        ("talks_nonsense", "job_crashed", "code 0"),
        ("dies_with_a_full_pipe", "job_crashed", "SIGKILL"),
        ("refuses", "truncated_file", "scan: the file ends in the middle of a triangle"),
    ],
)
def test_a_bad_end_is_a_failure_with_its_reason(
    make: Make, tmp_path: Path, target: str, code: str, words: str
) -> None:
    sandbox = make(target)
    for _ in range(2):  # the second shows that the zygote lives on
        outcome = run(sandbox, tmp_path)
        assert outcome.kind == "failed"
        assert outcome.problem is not None
        assert outcome.problem.code == code
        assert words in outcome.problem.detail
        assert "secret" not in outcome.problem.model_dump_json()


def test_a_good_end_is_done_and_its_progress_is_told(make: Make, tmp_path: Path) -> None:
    told: list[tuple[str, float, str]] = []
    task = {"folder": str(tmp_path), "out": str(tmp_path / "out")}
    outcome = make("obedient").run("job", task, lambda *step: told.append(step), lambda: True)
    assert outcome.kind == "done"
    assert told == [("load", 1.0, "reading"), ("report", 99.0, "writing")]
    assert (tmp_path / "out" / "results.json").is_file()


def test_a_hang_with_the_gil_held_is_stopped_at_the_time_limit(make: Make, tmp_path: Path) -> None:
    outcome = run(make("hangs_with_gil", time_s=0.5), tmp_path)
    assert outcome.problem is not None
    assert outcome.problem.code == "job_timed_out"
    assert outcome.seconds < 3.0


def test_a_job_cannot_forge_its_end(make: Make, tmp_path: Path) -> None:
    """What it writes is progress at best; the end is what the kernel says, and its limits hold until then."""
    victim = subprocess.Popen(["sleep", "600"], start_new_session=True)
    try:
        outcome = run(make("forges_its_end", time_s=0.5), tmp_path, victim=victim.pid)
        assert outcome.problem is not None and outcome.problem.code == "job_timed_out"
        assert outcome.seconds >= 0.5
        assert victim.poll() is None
    finally:
        victim.kill()
        victim.wait()


@pytest.mark.parametrize("answer", ["link", "pipe", "large", "deep", "other status", "more fields"])
def test_an_answer_that_is_not_ours_is_none(make: Make, tmp_path: Path, answer: str) -> None:
    sandbox = make("answers_badly")
    for said, code in ((answer, "job_crashed"), ("good", "no_surface")):
        folder = tmp_path / said.replace(" ", "_")
        folder.mkdir()
        outcome = run(sandbox, folder, answer=said)
        assert outcome.problem is not None and outcome.problem.code == code


def test_limits_hold_while_a_job_reports_without_an_end(make: Make, tmp_path: Path) -> None:
    task = {"folder": str(tmp_path)}
    heard: list[float] = []
    outcome = make("talkative", time_s=1.0).run(
        "job", task, lambda _, percent, __: heard.append(percent), lambda: True
    )
    assert outcome.problem is not None and outcome.problem.code == "job_timed_out"
    assert outcome.seconds < 3.0
    # The newest of each chunk, and one chunk in a while: some hundred thousand were written.
    assert 0 < len(heard) <= MAX_LINES * (outcome.seconds / READ_INTERVAL_S + 2)


def test_a_worker_that_does_not_listen_delays_no_other_job(make: Make, tmp_path: Path) -> None:
    """One dies with its pipe full while its worker waits for a database: the zygote waits for neither."""
    sandbox = make("any_of_them")
    bad, good = tmp_path / "bad", tmp_path / "good"
    bad.mkdir()
    good.mkdir()
    goes_on = threading.Event()

    def wait(*_: object) -> None:
        goes_on.wait(60)

    task = {"folder": str(bad), "misbehave": "dies_with_a_full_pipe"}
    thread = threading.Thread(target=sandbox.run, args=("bad", task, wait, lambda: True))
    thread.start()
    try:
        wait_until(lambda: (bad / "pid").exists() and not is_alive(int((bad / "pid").read_text() or 1)))
        task = {"folder": str(good), "out": str(good / "out"), "misbehave": "obedient"}
        assert sandbox.run("good", task, lambda *_: None, lambda: True).kind == "done"
        assert thread.is_alive()
    finally:
        goes_on.set()
        thread.join(60)


def test_an_unwanted_job_is_killed_within_three_seconds(make: Make, tmp_path: Path) -> None:
    outcome = run(make("hangs_with_gil"), tmp_path, wanted=lambda: False)
    assert outcome.kind == "unwanted"
    assert outcome.seconds < 3.0


@pytest.mark.parametrize("stay", [True, False])
@pytest.mark.parametrize("target", ["grandchild", "great_grandchildren"])
def test_nothing_a_job_started_outlives_it(make: Make, tmp_path: Path, target: str, stay: bool) -> None:
    run(make(target), tmp_path, wanted=lambda: not (tmp_path / "pids.json").exists(), stay=stay)
    pids = json.loads((tmp_path / "pids.json").read_text())
    wait_until(lambda: not any(map(is_alive, pids)))


def test_nothing_outlives_the_worker(make: Make, tmp_path: Path) -> None:
    sandbox = make("great_grandchildren")
    thread = threading.Thread(target=lambda: run(sandbox, tmp_path, stay=True))
    thread.start()
    wait_until(lambda: (tmp_path / "pids.json").exists())
    sandbox.stop()
    thread.join(60)
    pids = json.loads((tmp_path / "pids.json").read_text())
    assert len(pids) == 4
    wait_until(lambda: not any(map(is_alive, pids)))


def test_a_job_gets_neither_our_passwords_nor_our_keys(
    make: Make, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in (
        "CUSP_DATABASE_URL",
        "AWS_SECRET_ACCESS_KEY",
        "PGPASSWORD",
        "MY_TOKEN",
        "HTTPS_PROXY",
        "LD_PRELOAD_",
    ):
        monkeypatch.setenv(name, "secret")
    monkeypatch.setenv("LC_ALL", "C.UTF-8")
    assert run(make("shows_environment"), tmp_path).kind == "done"
    given = json.loads((tmp_path / "given.json").read_text())
    assert "secret" not in given["environment"].values()
    assert given["environment"]["LC_ALL"] == "C.UTF-8"
    assert given["environment"]["OPENBLAS_NUM_THREADS"] == "1"
    assert given["environment"]["PATH"] == os.environ["PATH"]
    assert given["largest_file"] == 1 << 30


def test_a_task_may_be_as_large_as_a_request(make: Make, tmp_path: Path) -> None:
    """A packet of the socket holds some 200 KB."""
    words = "ä" * 2_000_000
    assert run(make("shows_environment"), tmp_path, words=words).kind == "done"
    assert json.loads((tmp_path / "given.json").read_text())["task"]["words"] == words


@pytest.mark.parametrize(
    ("misbehave", "code"),
    [
        ("segfault", "job_crashed"),
        ("exits", "job_crashed"),
        ("raises", "job_crashed"),
        ("hangs_with_gil", "unwanted"),
        ("memory_hog", "job_out_of_memory"),
        ("giant_allocation", "job_out_of_memory"),
        ("great_grandchildren", "job_crashed"),
        ("fills_the_disk", "job_crashed"),
        ("talks_nonsense", "job_crashed"),
    ],
)
def test_a_neighbour_of_a_job_that_misbehaves_runs_on(
    make: Make, tmp_path: Path, misbehave: str, code: str
) -> None:
    sandbox = make("any_of_them")
    good, bad = tmp_path / "good", tmp_path / "bad"
    good.mkdir()
    bad.mkdir()
    outcomes: list[Outcome] = []

    def run_good() -> None:
        task = {"folder": str(good), "misbehave": "slow"}
        outcomes.append(sandbox.run("good", task, lambda *_: None, lambda: True))

    thread = threading.Thread(target=run_good)
    thread.start()
    wait_until(lambda: (good / "child.log").exists())
    outcome = run(sandbox, bad, misbehave=misbehave, wanted=lambda: code != "unwanted")
    assert (outcome.problem.code if outcome.problem else outcome.kind) == code
    assert outcomes == []
    (good / "go").touch()
    thread.join(60)
    assert [each.kind for each in outcomes] == ["done"]


def test_a_killed_zygote_fails_its_jobs_and_is_replaced(make: Make, tmp_path: Path) -> None:
    sandbox = make("slow")
    sandbox.start()
    assert sandbox._link is not None
    first = sandbox._link.process.pid
    outcomes: list[Outcome] = []
    thread = threading.Thread(target=lambda: outcomes.append(run(sandbox, tmp_path)))
    thread.start()
    wait_until(lambda: (tmp_path / "child.log").exists())
    os.kill(first, signal.SIGKILL)
    thread.join(60)
    assert outcomes[0].problem is not None
    assert outcomes[0].problem.code == "job_crashed"
    (tmp_path / "go").touch()
    assert run(sandbox, tmp_path).kind == "done"
    assert sandbox._link.process.pid != first


def test_a_job_whose_listener_fails_does_not_run_on(make: Make, tmp_path: Path) -> None:
    def fail(*_: object) -> None:
        raise ConnectionError("the database is away")

    def is_wanted() -> bool:
        if (tmp_path / "pids.json").exists():
            fail()
        return True

    sandbox = make("grandchild")
    with pytest.raises(ConnectionError):
        sandbox.run("job", {"folder": str(tmp_path), "stay": True}, fail, is_wanted)
    pids = json.loads((tmp_path / "pids.json").read_text())
    wait_until(lambda: not any(map(is_alive, pids)))


def test_a_fork_that_is_refused_is_tried_again_and_costs_no_other_job(
    make: Make, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("service.execution.sandbox.START_PAUSE_S", 0.01)
    sandbox = make("cannot_fork")
    folders = [tmp_path / name for name in ("a", "b")]
    outcomes: list[Outcome] = []
    threads = []
    for folder in folders:
        folder.mkdir()
        threads.append(threading.Thread(target=lambda folder=folder: outcomes.append(run(sandbox, folder))))
        threads[-1].start()
        wait_until(lambda folder=folder: (folder / "child.log").exists())
    for folder in folders:
        (folder / "go").touch()
    for thread in threads:
        thread.join(60)
    assert [outcome.kind for outcome in outcomes] == ["done", "done"]


def test_a_fork_that_stays_refused_fails_its_job_with_the_reason(
    make: Make, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("OMP_TEST_REFUSE", "always")
    monkeypatch.setattr("service.execution.sandbox.START_RETRY_S", 0.0)
    outcome = run(make("cannot_fork"), tmp_path)
    assert outcome.problem is not None and outcome.problem.code == "job_crashed"
    assert "temporarily unavailable" in outcome.problem.detail


def test_two_jobs_run_side_by_side(make: Make, tmp_path: Path) -> None:
    sandbox = make("slow")
    folders = [tmp_path / name for name in ("a", "b")]
    outcomes: list[Outcome] = []

    def run_one(folder: Path) -> None:
        folder.mkdir()
        task = {"folder": str(folder)}
        outcomes.append(sandbox.run(folder.name, task, lambda *_: None, lambda: True))

    threads = [threading.Thread(target=run_one, args=[folder]) for folder in folders]
    for thread in threads:
        thread.start()
    wait_until(lambda: all((folder / "child.log").exists() for folder in folders))
    for folder in folders:
        (folder / "go").touch()
    for thread in threads:
        thread.join(60)
    assert [outcome.kind for outcome in outcomes] == ["done", "done"]


def test_a_zygote_that_cannot_start_says_why(make: Make) -> None:
    with pytest.raises(SandboxError, match="libopengl0 is missing"):
        make("cannot_preload").start()


def test_a_worker_that_waits_for_a_job_does_not_spin(
    make: Make, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    calls: list[int] = []
    select_, asked = select.select, threading.Event()

    def counting(*given: Any) -> Any:
        calls.append(1)
        return select_(*given)

    def is_wanted() -> bool:
        if asked.is_set():
            (tmp_path / "go").touch()
        asked.set()
        return True

    monkeypatch.setattr("service.execution.sandbox.select.select", counting)
    assert run(make("slow"), tmp_path, wanted=is_wanted).kind == "done"
    # One wait ends by each of: the start, three messages, the closed pipe, the end, and every 0.2 s.
    assert len(calls) < 40
