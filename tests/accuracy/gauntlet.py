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
import json
import os
import tempfile
import time
from collections import Counter
from collections.abc import Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from dataclasses import asdict, dataclass, field
from itertools import islice
from multiprocessing import get_context
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

import pipeline
from pipeline.core.mesh import FloatArray, Mesh
from pipeline.kernels import icp, rigid
from pipeline.kernels.surface import Surface
from pipeline.search.scan_model import ScanPoints
from pipeline.search.schedule import REGISTRATION
from tests.accuracy import gauntlet_cases, peers
from tests.accuracy.bench import save
from tests.accuracy.gauntlet_cases import Case, Spec

CUSP = "cusp"
UNIT_ERROR = 0.02
SMALL_ERROR = 2e-4  # of the diagonal: what the choice of 10,000 points alone makes of a scan
WIDTH = 185
MEMORY_OF = (
    "arch_001C, scan, seed 0",
    "nist_am_artifact, scan, seed 0",
    "stanford_bunny, scan, seed 0",
    "demo arch, scan, seed 0",
)
ONE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


@dataclass(frozen=True, slots=True)
class Row:
    """What one tool made of one case. right : None where no pose is; at_rival : right, but only as one of
    `Case.rivals`, which the scan cannot tell from the truth, so it must not be called `ok`; *_share : of the
    diagonal; rms_true_share : how far the scan lies off the design under the nearest truth, to tell a wrong
    pose that fits better from one that does not;
    from_truth_share : error of ICP that starts at the truth
    """

    case: str
    group: str
    tool: str
    status: str
    expected: tuple[str, ...]
    right: bool | None
    seconds: float
    cpu_s: float
    error_share: float | None = None
    rotation_deg: float | None = None
    translation_share: float | None = None
    rms_share: float | None = None
    rms_true_share: float | None = None
    from_truth_share: float | None = None
    confidence: float | None = None
    findings: tuple[str, ...] = ()
    at_rival: bool = False
    flagged: bool = True
    right_but_refused: bool = False
    drift: float | None = None
    peak_mb: float | None = None
    detail: str = ""

    @property
    def wrong_but_ok(self) -> bool:
        return self.status == "ok" and (not self.right or self.at_rival)

    @property
    def over_truth(self) -> float | None:
        """Error over that of ICP started at the truth; errors below `SMALL_ERROR` are as good as none."""
        if self.error_share is None or self.from_truth_share is None:
            return None
        return max(self.error_share, SMALL_ERROR) / max(self.from_truth_share, SMALL_ERROR)

    @property
    def unexpected(self) -> bool:
        return self.tool == CUSP and (self.status not in self.expected or not self.flagged)


class Clock:
    """Seconds, and seconds of CPU, which a busy machine leaves alone, since it was made."""

    def __init__(self) -> None:
        self.wall, self.cpu = time.perf_counter(), time.process_time()

    def read(self) -> dict[str, float]:
        return {"seconds": time.perf_counter() - self.wall, "cpu_s": time.process_time() - self.cpu}


NO_TIME = {"seconds": 0.0, "cpu_s": 0.0}


@dataclass(frozen=True, slots=True)
class _Error:
    """Of a pose against the nearest truth."""

    right: bool
    at_rival: bool
    error_share: float
    rotation_deg: float
    translation_share: float
    rms_share: float
    rms_true_share: float
    from_truth_share: float


def error(case: Case, T_design_scan: FloatArray) -> _Error | None:
    """None where no pose is right."""
    if not case.truths:
        return None
    points, size = case.unit_factor * case.scan.vertices, case.design.diagonal_mm
    poses = (*case.truths, *case.rivals)
    far = [rigid.rms_displacement(T_design_scan, T, points) / size for T in poses]
    nearest = int(np.argmin(far))
    apart, truth = far[nearest], poses[nearest]
    surface, centroid = Surface(case.design), points.mean(axis=0, keepdims=True)

    def rms_share(T: FloatArray) -> float:
        return float(np.sqrt((surface.closest(rigid.transformed(T, points)).distance ** 2).mean())) / size

    return _Error(
        right=apart <= case.tolerance_share,
        at_rival=nearest >= len(case.truths),
        error_share=apart,
        rotation_deg=rigid.angle_deg(T_design_scan @ np.linalg.inv(truth)),
        translation_share=rigid.rms_displacement(T_design_scan, truth, centroid) / size,
        rms_share=rms_share(T_design_scan),
        rms_true_share=rms_share(truth),
        from_truth_share=rigid.rms_displacement(_icp_from(truth, case, points, surface), truth, points)
        / size,
    )


def _icp_from(truth: FloatArray, case: Case, points: FloatArray, surface: Surface) -> FloatArray:
    """Where ICP ends that starts at the truth: what the surfaces themselves allow. The pipeline's own
    number of points.
    """
    asked = pipeline.Settings().registration
    scan = Mesh(points, case.scan.faces)
    from_scan = ScanPoints.of(scan, asked.sample_points, 1)
    return icp.refine(
        from_scan.points,
        None if case.group == "depth camera" else from_scan.normals,  # which may face inwards
        from_scan.weights,
        surface,
        truth,
        max_distance_mm=asked.inlier_share * case.design.diagonal_mm,
        max_iterations=asked.max_iterations,
        tolerance_mm=REGISTRATION.convergence_share * case.design.diagonal_mm,
    ).T_target_source


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
            result = pipeline.register(design, scan, design_cache=cache)
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


def _row(case: Case, tool: str, status: str, took: dict[str, float], found: _Error | None) -> Row:
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
        *gauntlet_cases.CONDITIONS,
        "symmetric",
        "nearly symmetric",
        "fine pitch",
        "featureless bar",
        "depth camera",
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


@dataclass(slots=True)
class Log:
    """The lines of `--out`: what is in it, and what is added."""

    path: Path | None
    rows: dict[tuple[str, str], Row] = field(default_factory=dict)  # by case and tool

    def __post_init__(self) -> None:
        if self.path is not None and self.path.exists():
            self.rows = read_rows(self.path)

    def done(self) -> set[tuple[str, str]]:
        return {key for key, row in self.rows.items() if row.status not in {"not built", "crashed"}}

    def add(self, rows: Iterable[Row]) -> None:
        for row in rows:
            self.rows[row.case, row.tool] = row
            if self.path is not None:
                with self.path.open("a", encoding="utf-8") as file:
                    file.write(json.dumps(asdict(row)) + "\n")


def read_rows(path: Path) -> dict[tuple[str, str], Row]:
    """The last line of each case and tool; half a line, of an interrupted run, is left out."""
    last: dict[tuple[str, str], Row] = {}
    for line in path.read_text(encoding="utf-8").splitlines():
        try:
            words = json.loads(line)
        except json.JSONDecodeError:
            continue
        row = Row(**(words | {name: tuple(words[name]) for name in ("expected", "findings")}))
        last[row.case, row.tool] = row
    return last


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


def table(path: Path, console: Console | None = None) -> None:
    """The tables of a file of rows."""
    print_tables(list(read_rows(path).values()), console or Console(width=WIDTH))


def print_tables(rows: list[Row], console: Console) -> None:
    ours = [row for row in rows if row.tool == CUSP]
    there = {row.group for row in ours}
    groups = [group for group in gauntlet_cases.groups() if group in there]
    console.print(_quality(ours, groups))
    others = [name for name in peers.PEERS if any(row.tool == name for row in rows)]
    if others:
        console.print(_success(rows, [CUSP, *others], groups))
    memory = [row for row in rows if row.tool == "memory"]
    for row in memory:
        console.print(f"peak memory, {row.case}: {row.peak_mb:.0f} MB")
    for words, chosen in (
        ("wrong but ok", [row for row in ours if row.wrong_but_ok]),
        ("another verdict than expected", [row for row in ours if row.unexpected and not row.wrong_but_ok]),
        (
            "wrong pose",
            [row for row in ours if row.right is False and not row.unexpected and not row.wrong_but_ok],
        ),
    ):
        console.print(f"\n{words}: {len(chosen)}")
        for row in chosen:
            console.print(_line(row), soft_wrap=True, highlight=False)
    total = Counter(row.wrong_but_ok for row in ours)
    console.print(f"\n{total.total()} cases, {total[True]} wrong but ok")


def _quality(ours: list[Row], groups: list[str]) -> Table:
    made = Table(
        *(
            "group",
            "cases",
            "right pose",
            "expected verdict",
            "wrong but ok",
            "right called ok",
            "rotation, deg",
        ),
        *("translation, %", "over ICP from truth", "seconds", "of CPU"),
        title="Cusp; median, 95 % of the errors of right poses and of the seconds",
    )
    for group in [*groups, "all"]:
        rows = [row for row in ours if group in (row.group, "all")]
        posed = [row for row in rows if row.right is not None]
        right = [row for row in posed if row.right]
        may_be_ok = [row for row in right if "ok" in row.expected]
        made.add_row(
            *(group, str(len(rows)), _share(len(right), len(posed))),
            _share(sum(not row.unexpected for row in rows), len(rows)),
            str(sum(row.wrong_but_ok for row in rows)),
            _share(sum(row.status == "ok" for row in may_be_ok), len(may_be_ok)),
            _spread([row.rotation_deg for row in right if row.rotation_deg is not None]),
            _spread([100 * row.translation_share for row in right if row.translation_share is not None]),
            _spread([ratio for row in right if (ratio := row.over_truth) is not None]),
            *(_spread([row.seconds for row in rows], 1), _spread([row.cpu_s for row in rows], 1)),
            end_section=group == groups[-1],
        )
    return made


def _success(rows: list[Row], tools: list[str], groups: list[str]) -> Table:
    """Over the cases that every tool has run, so that the columns compare. A case for which all poses are
    wrong by their very data (`Case.drift`) counts against all. "+n refused": the right pose was found, and
    the verdict gave none; peers have no verdict.
    """
    of = {
        tool: {row.case: row for row in rows if row.tool == tool and row.right is not None} for tool in tools
    }
    common = set.intersection(*(set(cases) for cases in of.values()))
    made = Table("group", "cases", *tools, title="Right pose, same cases; every peer refined by the same ICP")
    for group in [*groups, "all"]:
        cases = [case for case in common if group in (of[CUSP][case].group, "all")]
        if cases:
            shares = [_share(sum(bool(of[tool][case].right) for case in cases), len(cases)) for tool in tools]
            refused = sum(of[CUSP][case].right_but_refused for case in cases)
            shares[0] += f" (+{refused} refused)" if refused else ""
            made.add_row(group, str(len(cases)), *shares)
    if common:
        for words, what in (("median s", "seconds"), ("median s of CPU", "cpu_s")):
            made.add_row(
                words,
                "",
                *(f"{np.median([getattr(of[t][case], what) for case in common]):.1f}" for t in tools),
            )
    return made


def _line(row: Row) -> str:
    words = f"  {row.case}: {row.status}, expected {' or '.join(row.expected)}"
    if row.error_share is not None:
        words += f"; {100 * row.error_share:.2f} % off"
        words += f" ({100 * row.rms_share:.2f} % rms, {100 * row.rms_true_share:.2f} % under the true pose)"
    if not row.flagged:
        words += "; no alternative is flagged symmetry_of_design"
    if row.confidence is not None:
        words += f"; confidence {row.confidence:.2f}"
    return words + f"; {', '.join(row.findings)}" * bool(row.findings) + f"; {row.detail}" * bool(row.detail)


def _share(count: int, of: int) -> str:
    return f"{count / of:.1%}" if of else "-"


def _spread(values: list[float], digits: int = 2) -> str:
    return f"{np.median(values):.{digits}f}, {np.quantile(values, 0.95):.{digits}f}" if values else "-"


def wanted(options: argparse.Namespace, console: Console) -> list[tuple[Spec, tuple[str, ...]]]:
    """The cases asked for, each with the tools it has to run."""
    specs = gauntlet_cases.specs(options.seeds)
    if options.groups:
        asked = set(options.groups.split(","))
        unknown = asked - {spec.group for spec in specs}
        if unknown:
            raise SystemExit(
                f"no such group: {', '.join(unknown)}; there are {', '.join(gauntlet_cases.groups())}"
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
    parser.add_argument("--peers", action="store_true", help="run the others too")
    parser.add_argument("--groups", help="only these, with commas between")
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
