"""What a job does to its folder delays no clock; a look that the job delays for long counts as too much."""

import os
import threading
from pathlib import Path
from typing import Any

import pytest

from service.execution import folder_watch
from service.execution.folder_size import TOO_MUCH, used_bytes
from service.execution.folder_watch import MAX_POLLS, FolderWatch


def test_a_look_that_never_ends_is_not_waited_for(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    ended = threading.Event()
    monkeypatch.setattr(folder_watch, "used_bytes", lambda *_: ended.wait(60) and 0)
    watch = FolderWatch(tmp_path, 1000)
    answers = [watch.is_over(None) for _ in range(MAX_POLLS + 2)]
    assert answers == [False] * (MAX_POLLS + 1) + [True]
    ended.set()
    watch.close()


def test_the_last_look_tells(tmp_path: Path) -> None:
    watch = FolderWatch(tmp_path, 1000)
    assert not watch.is_over(None) and not watch.is_over_at_the_end()
    with (tmp_path / "sparse").open("wb") as file:
        file.truncate(1001)
    while not watch.is_over(None):
        pass
    assert watch.is_over_at_the_end()
    watch.close()


@pytest.mark.parametrize(("times", "is_hidden"), [(1, False), (1000, True)])
def test_a_folder_that_is_moved_while_it_is_looked_at_hides_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, times: int, is_hidden: bool
) -> None:
    """times : that it is gone when its turn comes"""
    (tmp_path / "a").mkdir()
    (tmp_path / "a" / "file").write_bytes(bytes(5000))
    left, scandir = [times], os.scandir

    def moving(place: str) -> Any:
        if place.endswith("/a") and left[0] > 0:
            left[0] -= 1
            raise FileNotFoundError(place)
        return scandir(place)

    monkeypatch.setattr("os.scandir", moving)
    found = used_bytes(tmp_path, None)
    assert found == TOO_MUCH if is_hidden else 5000 <= found < 50_000
