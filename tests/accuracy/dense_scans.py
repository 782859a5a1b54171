"""Dense, noisy scans: is the working mesh as coarse as asked for, and what does a registration cost?
`python -m tests.accuracy.dense_scans --register` prints the table.

A scan is the design in smaller triangles, in another pose, with Gaussian noise along its normals (shares of
the diagonal, one sigma). `--triangles` and `--shares` choose; `--register` also registers each scan.
"""

import argparse
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import trimesh
from rich.console import Console
from rich.table import Table

import pipeline
from pipeline.core.mesh import Mesh
from pipeline.core.settings import Settings
from pipeline.kernels import remesh
from pipeline.stages.features import features_edge_mm
from pipeline.stages.resample import resample, working_edge_mm
from tests.accuracy.bench import read, save
from tests.support import shapes
from tests.support.data import data_folder

SHAPES = ("cad/so101_upper_arm.stl", "dental/arch_001C.ply", "scans/rocker_arm.obj", "cad/lattice_cone.stl")
MANY = 300_000  # triangles above which the scan is subdivided instead of remeshed, which takes minutes


def designs() -> Iterator[tuple[str, Mesh]]:
    """Real shapes with CUSP_DATA, else one by formula."""
    data = data_folder()
    if data is None:
        yield "blob", shapes.bumpy_blob(4)
        return
    for name in SHAPES:
        yield Path(name).stem, read(data / name)


def dense(mesh: Mesh, triangles: float) -> Mesh:
    """The same surface in about so many triangles."""
    if triangles > MANY:
        coarser = dense(mesh, triangles / 4)
        return Mesh(*trimesh.remesh.subdivide(coarser.vertices, coarser.faces))
    area_mm2 = float(mesh.face_areas_mm2().sum())
    return remesh.isotropic(mesh, float(np.sqrt(4 * area_mm2 / (np.sqrt(3) * triangles))), 4)


def noisy(mesh: Mesh, share: float) -> Mesh:
    noise_mm = np.random.default_rng(0).normal(0.0, share * mesh.diagonal_mm, (len(mesh.vertices), 1))
    return Mesh(mesh.vertices + noise_mm * mesh.vertex_normals(), mesh.faces)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--triangles", type=float, nargs="+", default=[1e4, 1.6e5])
    parser.add_argument("--shares", type=float, nargs="+", default=[0.0, 0.001, 0.003, 0.005])
    parser.add_argument("--register", action="store_true", help="also register each scan to its design")
    options = parser.parse_args()
    pipeline.preload()
    table = Table(title=f"Working mesh of {Settings().resample.target_vertices} vertices asked for")
    for column in (
        "design",
        "triangles of the scan",
        "noise",
        "vertices",
        "edge / asked",
        "fine edge / asked",
    ):
        table.add_column(column)
    for column in ("CPU s", "registration, CPU s", "status"):
        table.add_column(column)
    for name, design in designs():
        for triangles in options.triangles:
            clean = dense(design, triangles)
            for share in options.shares:
                table.add_row(name, *measured(design, noisy(clean, share), share, options.register))
    Console(width=140).print(table)


def measured(design: Mesh, scan: Mesh, share: float, register: bool) -> list[str]:
    """One row of the table."""
    settings, area_mm2 = Settings(), float(design.face_areas_mm2().sum())
    edge_mm = working_edge_mm(area_mm2, settings.resample.target_vertices)
    fine_mm = features_edge_mm(area_mm2, settings.features)
    begun = time.process_time()
    found = resample(scan, "scan", edge_mm, settings.resample, fine_edge_mm=fine_mm)
    took_s = time.process_time() - begun
    assert found.fine is not None
    row = [f"{len(scan.faces)}", f"{share:.1%}", f"{len(found.mesh.vertices)}"]
    row += [
        f"{remesh.edge_mm(found.mesh, 0.5) / edge_mm:.2f}",
        f"{remesh.edge_mm(found.fine, 0.5) / fine_mm:.2f}",
    ]
    row += [f"{took_s:.1f}"]
    if not register:
        return [*row, "", ""]
    with tempfile.TemporaryDirectory() as folder:
        files = (
            save(design, Path(folder) / "d.ply"),
            save(scan.moved(shapes.motion(3)), Path(folder) / "s.ply"),
        )
        begun = time.process_time()
        result = pipeline.register(*files, out=Path(folder) / "out")
        return [*row, f"{time.process_time() - begun:.1f}", result.verdict.status]


if __name__ == "__main__":
    main()
