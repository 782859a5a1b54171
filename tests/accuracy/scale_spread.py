"""Do scales along the axes scatter as their standard errors say?

    python -m tests.accuracy.scale_spread [--parts 40]

Parts of random size, up to 2 % off along each axis, each scanned once: noise of 0.1 % of the diagonal, of
single vertices or of neighbourhoods. Nothing was set on the last three shapes.
"""

import argparse

import numpy as np
from rich.console import Console
from rich.table import Table

from pipeline.core.mesh import FloatArray, Mesh
from pipeline.kernels import sampling
from pipeline.kernels.similarity import estimate_scale
from pipeline.kernels.surface import Surface
from tests.accuracy import unseen_shapes
from tests.support import shapes
from tests.support.retriangulated import retriangulated

NOISE_SHARE, SMOOTH_SHARE, WAVES, INLIER_SHARE = 0.001, 0.015, 200, 0.03  # of the diagonal
LARGEST, SAMPLES, COVERED = 0.02, 10_000, 1.96
DESIGNS = {
    "blob": lambda: shapes.bumpy_blob(5),
    "flat block": lambda: shapes.box((60.0, 40.0, 3.0), 5),
    "torus": lambda: shapes.torus(20.0, 6.0),
    "knot": unseen_shapes.knot,
    "hub": lambda: retriangulated(unseen_shapes.hub(), 1.2),
    "tray": lambda: retriangulated(unseen_shapes.tray(), 1.2),
}


def noise_of(part: Mesh, rng: np.random.Generator, *, is_smooth: bool) -> FloatArray:
    """(n,) mm, of each vertex."""
    sigma_mm = NOISE_SHARE * part.diagonal_mm
    if not is_smooth:
        return rng.normal(0.0, sigma_mm, len(part.vertices))
    turns = rng.normal(0, 1 / (SMOOTH_SHARE * part.diagonal_mm), (3, WAVES))
    phases = part.vertices @ turns + rng.uniform(0, 2 * np.pi, WAVES)
    return np.asarray(sigma_mm * np.sqrt(2 / WAVES) * np.cos(phases).sum(axis=1))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--parts", type=int, default=40)
    parts: int = parser.parse_args().parts
    table = Table("design", "noise", "SD of x, y, z, 1e-4", "standard error, 1e-4", "95 % interval holds it")
    for name, make in DESIGNS.items():
        design = make()
        surface, normals = Surface(design), design.vertex_normals()
        for is_smooth in (False, True):
            off, errors = [], []
            for seed in range(parts):
                rng = np.random.default_rng(seed)
                factors = 1 + rng.uniform(-LARGEST, LARGEST, 3)
                noise = noise_of(design, rng, is_smooth=is_smooth)
                scan = Mesh(design.vertices * factors + noise[:, None] * normals, design.faces)
                samples = sampling.on_surface(scan, SAMPLES, seed)
                equal, reach_mm = np.full(SAMPLES, 1 / SAMPLES), INLIER_SHARE * design.diagonal_mm
                found = estimate_scale(
                    *(samples.points, equal, surface, np.eye(4), reach_mm),
                    per_axis=True,
                    normals=samples.normals,
                )
                assert found is not None
                off.append(found.factors - factors)
                errors.append(found.standard_error)
            inside = np.abs(off) <= COVERED * np.array(errors)
            shown = (
                ", ".join(f"{1e4 * x:.1f}" for x in of(each, axis=0))
                for of, each in ((np.std, off), (np.median, errors))
            )
            table.add_row(name, "neighbourhoods" if is_smooth else "vertices", *shown, f"{inside.mean():.1%}")
    Console(width=110).print(table)


if __name__ == "__main__":
    main()
