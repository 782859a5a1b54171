"""How long the deviation of a large scan takes: `python -m tests.accuracy.deviation`

A part by formula and a print of it that is 0.3 % too large, a million triangles. Beside it trimesh's signed
distance on some of the vertices (it grows linearly with them), which must give the same distances.
"""

import statistics
import time
from collections.abc import Callable

import numpy as np
import trimesh
from rich.console import Console
from rich.table import Table

from pipeline.core.mesh import Mesh
from pipeline.core.settings import DeviationSettings
from pipeline.kernels.surface import Surface
from pipeline.stages.deviation import deviation, deviation_of_design
from pipeline.stages.registration import evaluate_fit
from tests.support import shapes

RUNS = 3
PEER_POINTS = 2_000


def seconds(step: Callable[[], object]) -> float:
    """Median of some runs."""
    taken = []
    for _ in range(RUNS):
        begun = time.perf_counter()
        step()
        taken.append(time.perf_counter() - begun)
    return statistics.median(taken)


def main() -> None:
    design, scan = shapes.bumpy_blob(levels=6), shapes.bumpy_blob(levels=8)
    scan = Mesh(scan.vertices * 1.003, scan.faces)
    surface, inlier_mm = Surface(design), 0.02 * design.diagonal_mm
    found = evaluate_fit(scan, scan.weights(), surface, np.eye(4), inlier_mm)
    one_segment = np.zeros(len(design.faces), dtype=np.int32)
    measured = deviation(scan, surface, found, one_segment, 0.1, DeviationSettings())

    table = Table(
        "what", "points", "seconds", title=f"Deviation: {len(scan.faces)} triangles on {len(design.faces)}"
    )

    def row(what: str, points: int, step: Callable[[], object]) -> None:
        table.add_row(what, str(points), f"{seconds(step):.2f}")

    n = len(scan.vertices)
    row(
        "closest points and RMSEs",
        n,
        lambda: evaluate_fit(scan, scan.weights(), surface, np.eye(4), inlier_mm),
    )
    row(
        "signs and statistics",
        n,
        lambda: deviation(scan, surface, found, one_segment, 0.1, DeviationSettings()),
    )
    row(
        "the other direction, with its search tree",
        len(design.vertices),
        lambda: deviation_of_design(scan, Surface(scan), Surface(design), found, inlier_mm, 0.1),
    )
    some = np.linspace(0, n - 1, PEER_POINTS).astype(np.int64)
    peer = trimesh.Trimesh(design.vertices, design.faces, process=False)
    theirs = -trimesh.proximity.signed_distance(peer, scan.vertices[some])
    row("trimesh", PEER_POINTS, lambda: trimesh.proximity.signed_distance(peer, scan.vertices[some]))
    console = Console()
    console.print(table)
    console.print(f"largest difference to trimesh: {np.abs(theirs - measured.signed_mm[some]).max():.1e} mm")


if __name__ == "__main__":
    main()
