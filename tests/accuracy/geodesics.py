"""Are the exact distances right, and how much faster than the libraries? `make bench` prints the tables.

(a) Side by side in one run with pygeodesic (exact), libigl (exact, when it can be imported) and potpourri3d
(heat method): one full source, then everything of CFSFDP against all pairs. (b) Growth with n at about 100
neighbours inside d_c.

Wall and CPU seconds of medians; ours runs in all threads, a single source and every other library in one.
"All pairs" is n times the median source of SOURCES evenly spread ones, and excludes sorting the pairs, which
the all-pairs route also has to do. Longer than other files: two tables that share their meshes and clocks.
"""

import json
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from rich.console import Console
from rich.table import Table

from pipeline.core.mesh import FloatArray, IndexArray, Mesh
from pipeline.core.settings import Settings
from pipeline.kernels import density_peaks
from pipeline.kernels.geodesics import GeodesicSolver, density_rank
from tests.conftest import data_folder
from tests.support import shapes

SOURCES, SOURCES_OF_LARGE = 3, 2
LARGE = 50_000  # vertices; libigl takes minutes there and is left out
QUANTILE = 0.02
NEIGHBOURS = 100
GROWTH_ACROSS = (
    50,
    71,
    100,
    141,
    200,
    283,
)  # of a torus with twice as many around: n = 2 across^2, 5k to 160k
RUNS_UP_TO = 25_000  # vertices for which growth is the median of three runs, not one
SLACK = 1e-9

Result = TypeVar("Result")


@dataclass(frozen=True, slots=True)
class Cost:
    wall_s: float
    cpu_s: float

    def __str__(self) -> str:
        return f"{self.wall_s:.3g} ({self.cpu_s:.3g})"


def timed(work: Callable[[], Result]) -> tuple[Cost, Result]:
    wall, cpu = time.perf_counter(), time.process_time()
    result = work()
    return Cost(time.perf_counter() - wall, time.process_time() - cpu), result


def median(costs: list[Cost]) -> Cost:
    return Cost(float(np.median([c.wall_s for c in costs])), float(np.median([c.cpu_s for c in costs])))


# --- (a) side by side


def meshes() -> Iterator[tuple[str, Mesh]]:
    """At 5k, 20k and 80k vertices; without CUSP_DATA blobs by formula of 10k and 41k."""
    data = data_folder()
    if data is None:
        yield from ((f"blob by formula, {levels} levels", shapes.bumpy_blob(levels)) for levels in (5, 6))
        return
    from pipeline.core.settings import CleanSettings
    from pipeline.kernels import remesh
    from pipeline.stages.clean import clean
    from pipeline.stages.resample import working_edge_mm
    from tests.accuracy.bench import read

    yield "arch_001C", read(data / "dental" / "arch_001C.ply")
    bunny = read(data / "scans" / "stanford_bunny.obj")
    for wanted in (20_000, 80_000):
        edge_mm = working_edge_mm(float(bunny.face_areas_mm2().sum()), wanted)
        yield (
            f"bunny, {wanted // 1000}k",
            clean(remesh.isotropic(bunny, edge_mm, 3), "mesh", CleanSettings()).mesh,
        )


def libraries(mesh: Mesh) -> Iterator[tuple[str, Callable[[], Callable[[int], FloatArray]]]]:
    """Name, and what builds the function from a source to its (n,) distances; pygeodesic first, as
    reference.
    """
    vertices, faces = mesh.vertices, mesh.faces

    def exact() -> Callable[[int], FloatArray]:
        from pygeodesic import geodesic

        solver = geodesic.PyGeodesicAlgorithmExact(vertices, faces)
        return lambda source: np.asarray(solver.geodesicDistances(np.array([source]))[0])

    def ours() -> Callable[[int], FloatArray]:
        return GeodesicSolver(vertices, faces).distances

    def heat() -> Callable[[int], FloatArray]:
        import potpourri3d

        solver = potpourri3d.MeshHeatMethodDistanceSolver(vertices, faces)
        return lambda source: np.asarray(solver.compute_distance(source))

    yield "pygeodesic (exact)", exact
    yield "Cusp (exact)", ours
    try:
        import igl
    except ImportError:
        igl = None
    if igl is not None and len(vertices) < LARGE:
        everywhere, wide = np.arange(len(vertices)), faces.astype(np.int64)
        nothing = np.zeros(0, dtype=np.int64)
        yield (
            f"libigl {getattr(igl, '__version__', '')}(exact)",
            lambda: (
                lambda source: np.asarray(
                    igl.exact_geodesic(vertices, wide, np.array([source]), nothing, everywhere, nothing)
                )
            ),
        )
    yield "potpourri3d (heat)", heat


def side_by_side(console: Console) -> None:
    table = Table(
        *("mesh", "n", "library", "build s", "a source s, wall (CPU)", "all pairs s", "times ours"),
        *("max rel. difference", "max error, % of diameter"),
        title=f"One full source: medians of {SOURCES} ({SOURCES_OF_LARGE} at 80k); error against pygeodesic "
        "over the same",
    )
    cfsfdp = Table(
        *(
            "mesh",
            "n",
            "d_c mm",
            "build",
            "d_c, rho",
            "delta",
            "peaks",
            "labels",
            "all of it",
            "halo as well",
        ),
        *("all pairs s", "ratio", "ratio in CPU s"),
        title=f"Everything of CFSFDP, q = {QUANTILE}: wall (CPU) seconds, medians of 3; "
        f"all pairs: pygeodesic, from {SOURCES} sources. Must reach on the arch: <= 1 s, >= 300x",
    )
    for name, mesh in meshes():
        n = len(mesh.vertices)
        sources = np.linspace(0, n - 1, SOURCES if n < LARGE else SOURCES_OF_LARGE).astype(int)
        rows: list[tuple[str, Cost, Cost, FloatArray]] = []
        for library, build in libraries(mesh):
            built, ask = timed(build)
            answers = [timed(lambda ask=ask, source=source: ask(int(source))) for source in sources]
            rows.append(
                (library, built, median([cost for cost, _ in answers]), np.stack([d for _, d in answers]))
            )
            console.print(f"{name}: {n} vertices, {library}: {rows[-1][2]} s a source")
        exact, ours = rows[0], rows[1]
        usable = np.isfinite(exact[3]) & (exact[3] > 0) & (exact[3] < 1e100) & np.isfinite(ours[3])
        diameter = float(exact[3][usable].max())
        for library, built, cost, d in rows:
            off = np.abs(d - exact[3])[usable]
            relative = float((off / exact[3][usable]).max())
            table.add_row(
                *(name, str(n), library, f"{built.wall_s:.3g}", str(cost), f"{n * cost.wall_s:.4g}"),
                *(f"{cost.wall_s / ours[2].wall_s:.1f}", "-" if d is exact[3] else f"{relative:.1e}"),
                "-" if d is exact[3] else f"{100 * float(off.max()) / diameter:.1e}",
            )
        table.add_section()
        if n < 10_000:  # q is a share of all pairs: at 80k vertices 0.02 is 1,600 neighbours
            steps = [everything(mesh) for _ in range(3)]
            costs = {step: median([each[step] for each in steps]) for step in steps[0] if step != "d_c"}
            whole, all_pairs = costs["all"], Cost(n * exact[2].wall_s, n * exact[2].cpu_s)
            cfsfdp.add_row(
                *(name, str(n), f"{steps[0]['d_c'].wall_s:.3f}"),
                *(str(costs[step]) for step in ("build", "rho", "delta", "peaks", "labels", "all", "halo")),
                *(f"{all_pairs.wall_s:.0f}", f"{all_pairs.wall_s / whole.wall_s:.0f}"),
                f"{all_pairs.cpu_s / whole.cpu_s:.0f}",
            )
            console.print(cfsfdp)
    console.print(table)


def everything(mesh: Mesh) -> dict[str, Cost]:
    """Seconds of each step of Rodriguez & Laio 2014 by exact distances, vertices counted; `all` is without
    the halo, `halo` with it; `d_c` carries mm.
    """
    rules = Settings.paper().segmentation
    costs: dict[str, Cost] = {}
    costs["build"], solver = timed(lambda: GeodesicSolver(mesh.vertices, mesh.faces))
    costs["rho"], (d_c, rho) = timed(lambda: solver.cutoff_density(QUANTILE, np.ones(solver.n)))
    costs["delta"], (uphill, delta) = timed(lambda: solver.nearest_denser(rho))
    peaks = np.flatnonzero(uphill < 0)

    def eccentricities() -> None:
        for peak, row in zip(peaks, solver.distances(peaks), strict=True):
            delta[peak] = row[np.isfinite(row)].max()

    def labelled() -> tuple[IndexArray, Any]:
        centres = density_peaks.choose_centres(
            *(rho, delta, peaks),
            delta_min=rules.delta_min_dc * d_c,
            rho_min=rules.rho_min_share * float(np.median(rho)),
            max_centres=rules.max_centres,
            n_centres=None,
        )
        return centres, density_peaks.assign(uphill, centres)

    costs["peaks"], _ = timed(eccentricities)
    costs["labels"], (centres, labels) = timed(labelled)
    costs["all"] = Cost(sum(c.wall_s for c in costs.values()), sum(c.cpu_s for c in costs.values()))
    halo, _ = timed(
        lambda: density_peaks.halo(
            rho, labels, len(centres), lambda asked: np.isfinite(solver.nearest_other(asked, labels, d_c))
        )
    )
    costs["halo"] = Cost(costs["all"].wall_s + halo.wall_s, costs["all"].cpu_s + halo.cpu_s)
    return costs | {"d_c": Cost(d_c, 0.0)}


# --- (b) growth


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


def main() -> None:
    if sys.argv[1:2] == ["grow"]:
        print(json.dumps(grow(int(sys.argv[2]))))
        return
    console = Console(width=190)
    growth(console)
    side_by_side(console)


if __name__ == "__main__":
    main()
