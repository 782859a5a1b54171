"""The second scan of a design is given what the first found out about it; the oldest goes when there is no
room.
"""

from pathlib import Path
from typing import Any

import pytest
from obstore.store import LocalStore

from service.execution.sandbox import Outcome
from service.storage.design_cache import DesignCache, name_of
from tests.support.service import Service

pytestmark = pytest.mark.storages

MIB = 1024 * 1024


def test_what_a_job_kept_of_its_design_is_given_to_the_next(service: Service) -> None:
    seen: list[bytes | None] = []

    def act(task: dict[str, Any], on_progress: Any, is_wanted: Any) -> Outcome:
        path = Path(task["design_cache"])
        seen.append(path.read_bytes() if path.exists() else None)
        path.write_bytes(b"an analysis")
        return service.sandbox.succeed(task, on_progress, is_wanted)

    service.sandbox.act = act
    for options in (
        "{}",
        "{}",
        '{"tolerance_mm": 0.2, "label": "no matter"}',
        '{"seed": 1}',
        '{"units": {"design": "m"}}',
    ):
        service.finished(options)
    assert seen == [None, b"an analysis", b"an analysis", None, None]


def test_a_job_that_is_dismissed_keeps_nothing_and_one_that_keeps_nothing_succeeds(service: Service) -> None:
    outcomes = iter(["fail", "succeed", "succeed"])
    seen: list[bool] = []

    def act(task: dict[str, Any], on_progress: Any, is_wanted: Any) -> Outcome:
        path = Path(task["design_cache"])
        seen.append(path.exists())
        if next(outcomes) == "fail":
            path.write_bytes(b"half of it")
            return Outcome("unwanted", None, 0.1, None)
        return service.sandbox.succeed(task, on_progress, is_wanted)

    service.sandbox.act = act
    states = [service.status(service.finished())["status"] for _ in range(3)]
    assert seen == [False, False, False]
    assert states[1:] == ["successful", "successful"]


def test_the_oldest_goes_first(tmp_path: Path) -> None:
    cache = DesignCache(LocalStore(tmp_path / "store", mkdir=True), limit_mib=2)
    for number in range(4):
        file = tmp_path / f"{number}.npz"
        file.write_bytes(bytes([number]) * (MIB - 100))
        cache.keep(f"{number:064x}", file)
    there = [cache.fetch(f"{number:064x}", tmp_path / "out") for number in range(4)]
    assert there == [False, False, True, True]
    assert (tmp_path / "out").read_bytes()[:1] == b"\x03"


def test_nothing_is_kept_that_does_not_fit_or_is_not_wanted(tmp_path: Path) -> None:
    file = tmp_path / "large"
    file.write_bytes(bytes(MIB + 1))
    for limit_mib in (1, 0):
        cache = DesignCache(LocalStore(tmp_path / str(limit_mib), mkdir=True), limit_mib)
        cache.keep("name", file)
        assert not cache.fetch("name", tmp_path / "out")
        assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    "changed",
    [
        {"tenant": "other"},
        {"blob_id": "sha256:b"},
        {"design": {"unit": "m", "filename": "a.stl"}},
        {"design": {"unit": "mm", "filename": "a.stl", "part": "2"}},
        {"settings": {"x": 2}},
        {"seed": 1},
    ],
)
def test_all_that_an_analysis_follows_from_is_in_its_name(changed: dict[str, Any]) -> None:
    given: dict[str, Any] = {
        "tenant": "own",
        "blob_id": "sha256:a",
        "design": {"unit": "mm", "filename": "a.stl"},
        "settings": {"x": 1},
        "seed": 0,
    }
    assert name_of(**given) == name_of(**given)
    assert name_of(**given) != name_of(**(given | changed))
    renamed = given | {"design": {"unit": "mm", "filename": "another.STL"}}
    assert name_of(**renamed) == name_of(**given)
