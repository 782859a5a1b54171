"""How the exact distances grow with n: seconds and memory at about 100 neighbours inside d_c."""

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from pipeline.core.mesh import FloatArray, IndexArray, Mesh
from pipeline.kernels.geodesics import GeodesicSolver, density_rank
from tests.accuracy.stopwatch import Cost, median, timed
from tests.support import shapes

NEIGHBOURS = 100
GROWTH_ACROSS = (50, 71, 100, 141, 200, 283)  # of a torus, twice as many around: n = 2 across^2, 5k to 160k
RUNS_UP_TO = 25_000  # vertices for which growth is the median of three runs, not one
SLACK = 1e-9


def bumpy_torus(across: int) -> Mesh:
    """One surface for every `across`, with saddles and bumps of several sizes and nothing symmetric."""
    torus = shapes.torus(20.0, 8.0, 2 * across, across)
    u, v = np.divmod(np.arange(len(torus.vertices)), across)
    u, v = u * np.pi / across, v * 2 * np.pi / across
    height = (
        0.5 * np.sin(3 * u + 1) * np.cos(2 * v)
        + 0.4 * np.sin(7 * u + 3 * v)
        + 0.25 * np.cos(11 * u - 5 * v + 2)
    )
    ring = 20.0 + (8.0 + height) * np.cos(v)
    vertices = np.stack([ring * np.cos(u), ring * np.sin(u), (8.0 + height) * np.sin(v)], axis=1)
    return Mesh(vertices, torus.faces)


def peak_rss_mib() -> float:
    """Of this process since it was exec'd; `ru_maxrss` would remember the memory of the process that
    started it.
    """
    (line,) = (
        line for line in Path("/proc/self/status").read_text().splitlines() if line.startswith("VmHWM")
    )
    return int(line.split()[1]) / 1024


def grow(across: int) -> dict[str, Any]:
    """Run in a process of its own: seconds and MiB of one n."""
    mesh = bumpy_torus(across)
    n = len(mesh.vertices)
    before = peak_rss_mib()
    solver = GeodesicSolver(mesh.vertices, mesh.faces)
    weights = np.ones(n)
    runs = 3 if n <= RUNS_UP_TO else 1
    balls = [timed(lambda: solver.cutoff_density(NEIGHBOURS / n, weights)) for _ in range(runs)]
    d_c, rho = balls[0][1]
    at_balls = peak_rss_mib()
    uphill, delta = solver.nearest_denser(rho)
    roots = np.flatnonzero(uphill < 0)
    far = (uphill >= 0) & (delta > 3 * d_c)
    climb = [
        timed(lambda: searches(solver, rho, np.flatnonzero((uphill >= 0) & ~far)))[0] for _ in range(runs)
    ]
    peaks = [timed(lambda: searches(solver, rho, np.flatnonzero(far)))[0] for _ in range(runs)]
    root = [timed(lambda: solver.distances(roots).max())[0] for _ in range(runs)]
    costs = {"balls": median([cost for cost, _ in balls]), "climb": median(climb)}
    costs |= {"peaks": median(peaks), "root": median(root)}
    return {
        **{step: [cost.wall_s, cost.cpu_s] for step, cost in costs.items()},
        "n": n,
        "neighbours": float(rho.mean()) - 1,
        "d_c": d_c,
        "n_peaks": int(far.sum()),
        "runs": runs,
        "before": before,
        "at_balls": at_balls,
        "at_end": peak_rss_mib(),
    }


def searches(solver: GeodesicSolver, rho: FloatArray, vertices: IndexArray) -> None:
    """What `nearest_denser` does for these vertices: there, and back for the canonical distance."""
    core, threads, silent = solver._core, solver._threads, None
    counts, found, d = core.nearest_denser(vertices, density_rank(rho), SLACK, threads, silent)
    i, j = np.repeat(vertices, np.asarray(counts)).astype(np.int64), np.asarray(found).astype(np.int64)
    core.between(j, i, np.asarray(d) * (1 + SLACK), threads, silent)


def growth(console: Console) -> None:
    table = Table(
        *("n", "neighbours", "d_c mm", "runs", "balls", "delta, others", "us a vertex, both", "CPU us, both"),
        *("delta, global peaks", "number", "reach of the densest", "MiB at start", "after balls", "at end"),
        title=f"Growth, bumpy torus by formula, q = {NEIGHBOURS}/n: wall (CPU) s. Global peaks: delta > 3 "
        "d_c. "
        "Must reach at 80k: balls <= 20 s, <= 1 GiB",
    )
    for across in GROWTH_ACROSS:
        command = [sys.executable, "-m", "tests.accuracy.geodesics", "grow", str(across)]
        done = subprocess.run(command, capture_output=True, text=True, check=True, timeout=900)
        row = json.loads(done.stdout)
        cost = {step: Cost(*row[step]) for step in ("balls", "climb", "peaks", "root")}
        wall, cpu = (cost["balls"].wall_s + cost["climb"].wall_s), (cost["balls"].cpu_s + cost["climb"].cpu_s)
        table.add_row(
            *(str(row["n"]), f"{row['neighbours']:.1f}", f"{row['d_c']:.3f}", str(row["runs"])),
            *(
                str(cost["balls"]),
                str(cost["climb"]),
                f"{1e6 * wall / row['n']:.0f}",
                f"{1e6 * cpu / row['n']:.0f}",
            ),
            *(str(cost["peaks"]), str(row["n_peaks"]), str(cost["root"])),
            *(f"{row[moment]:.0f}" for moment in ("before", "at_balls", "at_end")),
        )
        console.print(f"growth: {row['n']} vertices, balls {cost['balls']} s, {row['at_end']:.0f} MiB")
    console.print(table)
