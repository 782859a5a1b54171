"""The exact distances side by side with other libraries, and everything of CFSFDP against all pairs."""

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from pipeline.core.mesh import FloatArray, IndexArray, Mesh
from pipeline.core.settings import Settings
from pipeline.kernels import density_peaks
from pipeline.kernels.geodesics import GeodesicSolver
from tests.accuracy.stopwatch import Cost, median, timed
from tests.conftest import data_folder
from tests.support import shapes

SOURCES, SOURCES_OF_LARGE = 3, 2
LARGE = 50_000  # vertices; libigl takes minutes there and is left out
QUANTILE = 0.02


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
