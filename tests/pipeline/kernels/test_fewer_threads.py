"""A process that gets no further thread computes the same, with the threads that it has."""

import subprocess
import sys

SCRIPT = """
import resource
from pathlib import Path
import numpy as np
from pipeline.kernels.geodesics import GeodesicSolver
from tests.support import shapes

blob = shapes.bumpy_blob(2)
one, many = (GeodesicSolver(blob.vertices, blob.faces, threads=threads) for threads in (1, 4))
alone = one.distances(np.arange(8))  # keeps the stack of its thread for the next
mapped = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
limit = mapped + 4 * 2**20  # the stack of a thread takes 8 MiB
resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
print((many.distances(np.arange(8)) == alone).all())
"""


def test_without_room_for_a_thread_the_result_is_the_same() -> None:
    done = subprocess.run([sys.executable, "-c", SCRIPT], capture_output=True, text=True)
    assert done.stdout == "True\n", done.stderr
