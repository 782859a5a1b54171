"""The gauntlet: is the pose right, is the verdict, and what do others find? `python -m
tests.accuracy.gauntlet --peers`

Every case of `gauntlet_cases.py` goes through `pipeline.register` on two PLY files, and with `--peers`
through each of `peers.py`. One line of JSON a case and tool is appended to `--out` as it finishes; what is
there already is not run again, so an interrupted run goes on; a new version of the pipeline needs a new file.
`--table FILE` prints the tables of such a file only.

Right: RMS displacement of the scan's vertices to the nearest equivalent true pose within the case's
tolerance: 1 % of the design's diagonal, twice the warp where that is more, 5 % for the depth camera; for a
scan in other units also the unit. Wrong but `ok`: status `ok` and no right pose, or no pose is right.
Rotation error: angle between the found and the nearest true pose; translation error: distance between the
scan's centroids under the two, in % of the diagonal.
"""

import argparse
import hashlib
import os
import re
import tempfile
import time
from collections.abc import Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from dataclasses import asdict
from itertools import islice
from multiprocessing import get_context
from pathlib import Path

import numpy as np
from rich.console import Console

import pipeline
from tests.accuracy import gauntlet_cases, gauntlet_scanners, gauntlet_specs, peers
from tests.accuracy.bench import save
from tests.accuracy.gauntlet_cases import Case
from tests.accuracy.gauntlet_error import PoseError, error
from tests.accuracy.gauntlet_rows import CUSP, Log, Row
from tests.accuracy.gauntlet_specs import Spec
from tests.accuracy.gauntlet_tables import WIDTH, print_tables, table

UNIT_ERROR = 0.02
MEMORY_OF = (
    "arch_001C, scan, seed 0",
    "nist_am_artifact, scan, seed 0",
    "stanford_bunny, scan, seed 0",
    "demo arch, scan, seed 0",
)
ONE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


class Clock:
    """Seconds, and seconds of CPU, which a busy machine leaves alone, since it was made."""

    def __init__(self) -> None:
        self.wall, self.cpu = time.perf_counter(), time.process_time()

    def read(self) -> dict[str, float]:
        return {"seconds": time.perf_counter() - self.wall, "cpu_s": time.process_time() - self.cpu}


NO_TIME = {"seconds": 0.0, "cpu_s": 0.0}


def run_cusp(case: Case, kept: Path | None = None) -> Row:
    """kept : folder with the analyses of designs, as a worker keeps them for the next scan; None makes
    each anew
    """
    with tempfile.TemporaryDirectory() as folder:
        design, scan = (
            save(case.design, Path(folder) / "design.ply"),
            save(case.scan, Path(folder) / "scan.ply"),
        )
        cache = None if kept is None else kept / f"{hashlib.sha256(design.read_bytes()).hexdigest()}.npz"
        clock = Clock()
        try:
            result = pipeline.register(
                design, scan, scan_accuracy_mm=case.scan_accuracy_mm, design_cache=cache
            )
        except pipeline.PipelineError as refused:
            return _row(case, CUSP, f"refused: {refused.code}", clock.read(), None)
        took = clock.read()
    found = None if result.transform is None else error(case, np.array(result.transform.matrix))
    refused = None
    if result.transform is None and result.alternatives and case.unit_factor == 1.0:
        refused = error(case, np.array(result.alternatives[0].matrix))
    status = result.verdict.status
    right = None if found is None else found.right
    if case.unit_factor != 1.0 and right:
        factor = None if result.scale is None else result.scale.unit_factor
        right = factor is not None and abs(factor / case.unit_factor - 1) < UNIT_ERROR
    row = _row(case, CUSP, status, took, found)
    flagged = any(other.symmetry_of_design for other in result.alternatives)
    return _with(
        row,
        right=row.right and right,
        right_but_refused=refused is not None and refused.right and not refused.at_rival,
        confidence=result.verdict.confidence,
        findings=tuple(finding.code for finding in result.verdict.findings),
        flagged=flagged or not (case.symmetric and status == "ok"),
    )


def run_peer(case: Case, name: str) -> Row:
    """None of them has a verdict: `pose` or `none`."""
    clock = Clock()
    try:
        T = peers.PEERS[name](case.design, case.scan, 0)
    except Exception as failed:  # a peer that raises has no pose, and the run goes on
        return _with(_row(case, name, "raised", clock.read(), None), detail=repr(failed)[:200])
    took = clock.read()
    bad = T is None or not np.isfinite(T).all() or np.linalg.det(T[:3, :3]) <= 0
    return _row(case, name, "none" if bad else "pose", took, None if bad else error(case, T))


def _row(case: Case, tool: str, status: str, took: dict[str, float], found: PoseError | None) -> Row:
    right = None if not case.truths else False
    measured = {"right": right} if found is None else asdict(found)
    expected = tuple(sorted(case.expected))
    return Row(case.name, case.group, tool, status, expected, drift=case.drift, **took, **measured)


def _with(row: Row, **changed: object) -> Row:
    return Row(**(asdict(row) | changed))


def compared(spec: Spec) -> bool:
    """Peers have no word for what is not there, or is in another unit: they run where there is a pose to
    find.
    """
    return spec.group in {
        *gauntlet_specs.CONDITIONS,
        "symmetric",
        "nearly symmetric",
        "fine pitch",
        "featureless bar",
        "depth camera",
        *(gauntlet_scanners.CAMERA, gauntlet_scanners.LIGHT, gauntlet_scanners.DENTAL, gauntlet_scanners.CT),
    }


def run_spec(spec: Spec, tools: tuple[str, ...], kept: Path | None) -> list[Row]:
    """In a worker: the case is made once for all tools."""
    try:
        case = gauntlet_cases.build(spec)
    except Exception as failed:
        return [
            Row(spec.name, spec.group, tools[0], "not built", (), None, **NO_TIME, detail=repr(failed)[:300])
        ]
    rows = []
    for tool in tools:
        try:
            rows.append(run_cusp(case, kept) if tool == CUSP else run_peer(case, tool))
        except Exception as failed:  # a crash of one case is a line in the list, not the end of the run
            rows.append(_with(_row(case, tool, "crashed", NO_TIME, None), detail=repr(failed)[:300]))
    return rows


def peak_mb(spec: Spec) -> Row:
    """In a process of its own: the most resident memory of one registration, imports included.

    VmHWM, not `ru_maxrss`: the latter starts at what the parent had.
    """
    row = run_cusp(gauntlet_cases.build(spec))
    status = Path("/proc/self/status").read_text()
    line = next(line for line in status.splitlines() if line.startswith("VmHWM"))
    return _with(row, tool="memory", peak_mb=int(line.split()[1]) / 1024)


def run(
    todo: list[tuple[Spec, tuple[str, ...]]], processes: int, kept: Path | None
) -> Iterator[tuple[Spec, list[Row]]]:
    """Case by case as they finish. A case whose process dies is tried once more alone, then written down
    as such.
    """
    suspects: list[tuple[Spec, tuple[str, ...]]] = []
    left = iter(todo)
    while batch := list(islice(left, 2 * processes)):
        with _pool(processes) as pool:
            running: dict[Future[list[Row]], tuple[Spec, tuple[str, ...]]] = {}
            while batch or running:
                running |= {pool.submit(run_spec, *task, kept): task for task in batch}
                done, _ = wait(running, return_when=FIRST_COMPLETED)
                broken = False
                for future in done:
                    task = running.pop(future)
                    try:
                        yield task[0], future.result()
                    except BrokenProcessPool:
                        suspects.append(task)
                        broken = True
                if broken:
                    suspects += running.values()
                    break
                batch = list(islice(left, len(done)))
    for spec, tools in suspects:
        try:
            with _pool(1) as pool:
                yield spec, pool.submit(run_spec, spec, tools, kept).result()
        except BrokenProcessPool:
            yield (
                spec,
                [
                    Row(spec.name, spec.group, tool, "crashed", (), None, **NO_TIME, detail="died")
                    for tool in tools
                ],
            )


def _pool(processes: int) -> ProcessPoolExecutor:
    return ProcessPoolExecutor(processes, mp_context=get_context("spawn"), initializer=pipeline.preload)


def wanted(options: argparse.Namespace, console: Console) -> list[tuple[Spec, tuple[str, ...]]]:
    """The cases asked for, each with the tools it has to run."""
    specs = gauntlet_specs.specs(options.seeds, options.first_seed)
    if options.groups:
        asked = set(re.split(r",(?! )", options.groups))  # names of groups hold ", "
        unknown = asked - {spec.group for spec in specs}
        if unknown:
            raise SystemExit(
                f"no such group: {', '.join(unknown)}; there are {', '.join(gauntlet_specs.groups())}"
            )
        specs = [spec for spec in specs if spec.group in asked]
    found, lines = peers.installed() if options.peers else ({}, [])
    for line in lines:
        console.print(line)
    return [(spec, (CUSP, *(found if compared(spec) else ()))) for spec in specs[: options.limit]]


def measure_memory(todo: list[tuple[Spec, tuple[str, ...]]], log: Log) -> None:
    """A fresh process each, for the few of `MEMORY_OF` that are asked for and not there yet."""
    for spec, _ in todo:
        if spec.name in MEMORY_OF and (spec.name, "memory") not in log.done():
            with _pool(1) as pool:
                log.add([pool.submit(peak_mb, spec).result()])


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seeds", type=int, default=1, help="cases of each kind")
    parser.add_argument("--first-seed", type=int, default=0, help="seed of the first of them")
    parser.add_argument("--peers", action="store_true", help="run the others too")
    parser.add_argument("--groups", help="only these, with commas and no spaces between")
    parser.add_argument("--limit", type=int, help="only so many cases, from the first")
    parser.add_argument(
        "--out", type=Path, help="a line of JSON a case and tool; what is in it is not run again"
    )
    parser.add_argument(
        "--design-cache", type=Path, help="folder that keeps the analyses of designs, as a worker does"
    )
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument(
        "--table", type=Path, metavar="FILE", help="run nothing, print the tables of this file"
    )
    options = parser.parse_args()
    console = Console(width=WIDTH)
    if options.table:
        table(options.table, console)
        return
    os.environ |= dict.fromkeys(ONE_THREAD, "1")  # for the workers: as many threads as processes
    if options.design_cache is not None:
        options.design_cache.mkdir(parents=True, exist_ok=True)
    log = Log(options.out)
    todo, done = wanted(options, console), log.done()
    missing = [(spec, tuple(tool for tool in tools if (spec.name, tool) not in done)) for spec, tools in todo]
    missing = [(spec, tools) for spec, tools in missing if tools]
    start = time.perf_counter()
    for number, (_, rows) in enumerate(run(missing, options.processes, options.design_cache), start=1):
        log.add(rows)
        elapsed = time.perf_counter() - start
        for row in rows:
            if row.tool == CUSP:
                off = "" if row.error_share is None else f", {100 * row.error_share:.2f} % off"
                mark = " WRONG BUT OK" if row.wrong_but_ok else " unexpected" if row.unexpected else ""
                words = f"{row.case}: {row.status}{off}, {row.seconds:.1f} s{mark}"
                console.print(
                    f"{number}/{len(missing)} {elapsed:.0f} s  {words}", soft_wrap=True, highlight=False
                )
    measure_memory(todo, log)
    asked = {spec.name for spec, _ in todo}
    print_tables([row for row in log.rows.values() if row.case in asked], console)


if __name__ == "__main__":
    main()
