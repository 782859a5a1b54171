"""What is no progress message of ours is dropped, and what is one can be stored."""

import os

import pytest

from service.execution.progress_pipe import ProgressReader


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ('["load", 1, "load: design"]', ("load", 1.0, "load: design")),
        ('["load", 101, "a\\u0000b"]', ("load", 100.0, "ab")),
        ('["load", 1, "\\ud800"]', None),  # half of a surrogate pair: no database stores it
        (f'["load", 1{"0" * 400}, "large"]', None),
        ('["load", NaN, "no number"]', None),
        ('["end", 1, "no stage"]', None),
        ('["load", 1, 5]', None),
        ('{"event": "ended", "status": 0}', None),
        ("[" * 4000, None),
    ],
)
def test_a_line(line: str, message: tuple[str, float, str] | None) -> None:
    read_fd, write_fd = os.pipe()
    os.write(write_fd, line.encode() + b"\n")
    os.close(write_fd)
    assert list(ProgressReader(read_fd).read()) == ([] if message is None else [message])
    os.close(read_fd)
