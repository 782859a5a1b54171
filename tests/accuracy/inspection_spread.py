"""Do values of the inspection scatter as their standard errors say, and is the decision repeatable?

    python -m tests.accuracy.inspection_spread [--design knot] [--noise smooth] [--alignment rps]

One print by formula, with a bump and a smooth warp, is scanned many times: noise of single vertices, or of
neighbourhoods of about a millimetre, and a random pose each time. The truth of each value is that of a scan
without noise. Nothing was set on `knot` and `hub`.
"""

import argparse
import tempfile
from collections import Counter
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

import pipeline
from pipeline import Acceptance
from pipeline.core.alignment import RpsFit
from pipeline.core.mesh import FloatArray, Mesh
from pipeline.core.results import RegistrationResult
from pipeline.kernels import sampling
from tests.accuracy import unseen_shapes
from tests.accuracy.bench import save
from tests.support import shapes
from tests.support.retriangulated import retriangulated

NOISE_MM, BUMP_MM, WARP_MM, TOLERANCE_MM = 0.03, 0.25, 0.05, 0.2
POINTS, RADIUS_MM = 12, 2.0
DESIGNS = {
    "blob": lambda: shapes.bumpy_blob(5),
    "knot": unseen_shapes.knot,
    "hub": lambda: retriangulated(unseen_shapes.hub(), 1.2),
}
SMOOTH_MM, WAVES = 1.0, 200  # correlation length of smooth noise, and waves that it is the sum of
REFERENCE_POINTS = 9
COVERED = 1.96  # standard errors of a 95 % interval of the normal distribution


def printed(design: Mesh) -> Mesh:
    """The print: warped, and with a bump 5 mm wide."""
    normals = design.vertex_normals()
    along = design.vertices[:, 0] / float(np.abs(design.vertices[:, 0]).max())
    away = np.linalg.norm(design.vertices - design.vertices[100], axis=1)
    height = WARP_MM * along + BUMP_MM * np.exp(-((away / 2.5) ** 4))
    return Mesh(design.vertices + height[:, None] * normals, design.faces)


def scanned(part: Mesh, seed: int, *, is_smooth: bool) -> Mesh:
    rng = np.random.default_rng(seed)
    noise = rng.normal(0.0, NOISE_MM, len(part.vertices))
    if is_smooth:
        phases = part.vertices @ rng.normal(0, 1 / SMOOTH_MM, (3, WAVES)) + rng.uniform(0, 2 * np.pi, WAVES)
        noise = NOISE_MM * np.sqrt(2 / WAVES) * np.cos(phases).sum(axis=1)
    noisy = Mesh(part.vertices + noise[:, None] * part.vertex_normals(), part.faces)
    return noisy.moved(shapes.motion(seed))


def acceptance(design: Mesh) -> Acceptance:
    chosen = np.linspace(0, len(design.vertices) - 1, POINTS).astype(int)
    points = [
        {
            "name": f"P{number:02}",
            "position_mm": design.vertices[vertex].tolist(),
            "radius_mm": RADIUS_MM,
            "tolerance_mm": TOLERANCE_MM,
        }
        for number, vertex in enumerate(chosen)
    ]
    return Acceptance.model_validate({"tolerance_mm": TOLERANCE_MM, "points": points})


def reference_points(design: Mesh) -> RpsFit:
    """Far from each other, each held along its normal."""
    normals = design.vertex_normals()
    points = [
        {
            "name": f"R{number}",
            "position_mm": design.vertices[vertex].tolist(),
            "direction": normals[vertex].tolist(),
            "radius_mm": RADIUS_MM,
        }
        for number, vertex in enumerate(sampling.farthest(design.vertices, REFERENCE_POINTS).tolist())
    ]
    return RpsFit.model_validate({"kind": "rps", "points": points})


def values(result: RegistrationResult) -> tuple[FloatArray, FloatArray]:
    """(k,) value and standard error of each check that has both."""
    assert result.inspection is not None
    checks = [check for check in result.inspection.checks if check.unit == "mm"]
    found = [(check.value or np.nan, check.uncertainty or np.nan) for check in checks]
    return np.array([each[0] for each in found]), np.array([each[1] for each in found])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--scans", type=int, default=20)
    parser.add_argument("--design", choices=DESIGNS, default="blob")
    parser.add_argument("--noise", choices=("vertices", "smooth"), default="vertices")
    parser.add_argument("--alignment", choices=("best_fit", "rps"), default="best_fit")
    asked = parser.parse_args()
    scans: int = asked.scans
    pipeline.preload()
    design = DESIGNS[asked.design]()
    part, limits = printed(design), acceptance(design)
    alignment = reference_points(design) if asked.alignment == "rps" else None
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        save(design, folder / "design.ply")

        def measured(scan: Mesh) -> RegistrationResult:
            save(scan, folder / "scan.ply")
            return pipeline.register(
                *(folder / "design.ply", folder / "scan.ply"),
                acceptance=limits,
                alignment=alignment,
                design_cache=folder / "cache",
            )

        exact = measured(part)
        truth, _ = values(exact)
        results = [
            measured(scanned(part, seed, is_smooth=asked.noise == "smooth")) for seed in range(1, scans + 1)
        ]
    assert exact.inspection is not None
    names = [check.name for check in exact.inspection.checks if check.unit == "mm"]
    found, errors = (np.array(each) for each in zip(*map(values, results), strict=True))
    table = Table("check", "truth, mm", "mean, mm", "SD, mm", "standard error, mm", "95 % interval holds it")
    # A value that the scan does not show, or that is of the design's side and has no error, has no interval
    known = np.isfinite(found) & np.isfinite(errors)
    holds = np.abs(found - truth) <= COVERED * errors
    for number, check in enumerate(names):
        some = known[:, number]
        table.add_row(
            check,
            f"{truth[number]:+.4f}",
            f"{np.nanmean(found[:, number]):+.4f}",
            f"{np.nanstd(found[:, number], ddof=1):.4f}",
            f"{np.median(errors[some, number]):.4f}",
            f"{holds[some, number].mean():.0%} of {some.sum()}",
        )
    console = Console(width=120)
    console.print(table)
    is_point = np.array([name.startswith("P") for name in names])
    of_points = holds[:, is_point][known[:, is_point]]
    console.print(f"points together: {of_points.mean():.1%} of {of_points.size} intervals hold the truth")
    decisions = Counter(each.inspection.decision for each in results if each.inspection is not None)
    console.print(
        f"decisions of {scans} scans: {dict(decisions)}; without noise: {exact.inspection.decision}"
    )
    console.print(f"verdicts: {dict(Counter(each.verdict.status for each in results))}")


if __name__ == "__main__":
    main()
