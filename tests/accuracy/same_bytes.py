"""Same input, same bytes? `python -m tests.accuracy.same_bytes` runs one registration twenty times, each in a
process of its own, with 1 to 4 threads on one core or all, and compares every file; `timings_s` of
results.json is left out.
"""

import argparse
import hashlib
import json
import os
import subprocess
import sys
import tempfile
from collections import defaultdict
from pathlib import Path

from pipeline.core.mesh import Mesh
from tests.accuracy.bench import save
from tests.accuracy.budgets import arches

#: The processors are chosen before numpy and open3d are imported: they count them then.
SCRIPT = """
import os, sys
from pathlib import Path
design, scan, out, cores = sys.argv[1:]
if cores == "one":
    os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
import pipeline
pipeline.register(design, scan, out=Path(out))
"""
THREADS_OF = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


def digests(folder: Path) -> dict[str, str]:
    """SHA-256 of each file."""
    found = {}
    for path in sorted(folder.iterdir()):
        content = path.read_bytes()
        if path.name == "results.json":
            content = json.dumps(json.loads(content) | {"timings_s": None}).encode()
        found[path.name] = hashlib.sha256(content).hexdigest()
    return found


def run(design: Path, scan: Path, out: Path, threads: int, cores: str) -> dict[str, str]:
    environment = os.environ | dict.fromkeys(THREADS_OF, str(threads))
    subprocess.run([sys.executable, "-c", SCRIPT, design, scan, out, cores], check=True, env=environment)
    return digests(out)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--runs", type=int, default=20)
    options = parser.parse_args()
    pairs: dict[str, tuple[Mesh, Mesh]] = arches()
    name, (design, scan) = next(iter(pairs.items()))
    seen: dict[str, set[str]] = defaultdict(set)
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        files = save(design, folder / "design.ply"), save(scan, folder / "scan.ply")
        for number in range(options.runs):
            threads, cores = 1 + number % 4, ("all", "one")[number // 4 % 2]
            for file, digest in run(*files, folder / str(number), threads, cores).items():
                seen[file].add(digest)
            print(f"{number + 1}/{options.runs} {threads} threads, {cores} of the cores", flush=True)
    for file, found in seen.items():
        print(f"{file}: {len(found)} different")
    differ = sum(len(found) > 1 for found in seen.values())
    print(f"{name}, {options.runs} runs: {len(seen)} files, {differ} of them not always the same")


if __name__ == "__main__":
    main()
