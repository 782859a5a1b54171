"""Changed files of every format end with contents or with an error of the project: no crash, no hang, and no
more memory than the limits allow. Some hundred in a plain run, 100,000 at night.
"""

import multiprocessing
import random
import resource
import signal
import traceback
from collections import Counter
from pathlib import Path

import pytest

from pipeline import Format, PipelineError
from pipeline.core.mesh import Mesh
from pipeline.core.settings import LoadSettings
from pipeline.stages.load.contents import joined
from pipeline.stages.load.parts import choose_part
from pipeline.stages.load.reading import READERS
from tests.support.fuzzed_files import fuzzed, seeds

#: Files have at most some 10 kB, so that what they may hold takes little.
SETTINGS = LoadSettings(max_faces=20_000, max_points=20_000)
#: Address space above that of the process. Derived: 200 times 10 kB unpacked, and arrays of 20,000 points.
MEMORY_BYTES = 512 << 20
#: One file is hanging after this. Chosen by hand: a whole one takes milliseconds.
HANGING_S = 20
KINDS = sorted(seeds())
IN_ALL = 100_000


def _read(kind: str, data: bytes) -> str:
    try:
        contents = READERS[Format(kind)](data, SETTINGS)
        Mesh(*joined(choose_part(contents, None)))
    except PipelineError as refused:
        assert refused.reason
        return refused.code
    return "read"


def _fuzz(kind: str, first: int, count: int, found: "multiprocessing.queues.SimpleQueue[object]") -> None:
    """Read `count` files, in a process of its own; put what happened, or the number of a file that failed."""
    files = seeds()[kind]
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    ours = pages * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (ours + MEMORY_BYTES, ours + MEMORY_BYTES))
    outcomes: Counter[str] = Counter()
    for number in range(first, first + count):
        data = fuzzed(kind, random.Random(number), files)
        signal.alarm(HANGING_S)
        try:
            outcomes[_read(kind, data)] += 1
        except BaseException:
            found.put((number, traceback.format_exc()))
            return
        found.put(number) if number % 100 == 0 else None
    signal.alarm(0)
    found.put(outcomes)


def fuzz(kind: str, first: int, count: int) -> Counter[str]:
    """What `count` files from number `first` on come to; an AssertionError names the file that failed."""
    context = multiprocessing.get_context("fork")
    found = context.SimpleQueue()
    child = context.Process(target=_fuzz, args=(kind, first, count, found))
    child.start()
    last: object = first
    while True:
        while found.empty() and child.is_alive():
            child.join(0.05)
        if found.empty():
            raise AssertionError(f"{kind}: the process died after file {last}, exit {child.exitcode}")
        last = found.get()
        if isinstance(last, Counter):
            child.join()
            return last
        if isinstance(last, tuple):
            raise AssertionError(f"{kind}, file {last[0]}: {last[1]}")


@pytest.mark.timeout(3600)
@pytest.mark.parametrize("count", [60, pytest.param(IN_ALL // len(KINDS) + 1, marks=pytest.mark.nightly)])
@pytest.mark.parametrize("kind", KINDS)
def test_a_changed_file_is_read_or_refused(kind: str, count: int) -> None:
    outcomes = fuzz(kind, 0, count)
    assert outcomes.total() == count
    assert len(outcomes) >= 3, outcomes  # read, and refused for several reasons


@pytest.mark.parametrize("kind", KINDS)
def test_the_files_that_are_changed_are_good(kind: str) -> None:
    outcomes = [_read(kind, data) for data in seeds()[kind]]
    assert outcomes.count("read") >= len(outcomes) - 2, outcomes
