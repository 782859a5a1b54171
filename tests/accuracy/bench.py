"""Does the whole job find the pose, and in how many seconds? `make bench` prints a table.

Each design is registered to a copy with another triangulation, noise of 0.1 % and a smooth warp of 0.3 % of
the diagonal, in a random pose, whole and with 30 % cut off; then the real pairs of CUSP_DATA, and parts that
are not the design. Error: RMS displacement of the scan's vertices to the nearest equivalent true pose, in %
of the design's diagonal.
"""

import json
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import trimesh
from rich.console import Console
from rich.table import Table

import pipeline
from pipeline.core.mesh import FloatArray, Mesh
from pipeline.core.settings import CleanSettings, LoadSettings
from pipeline.kernels import rigid
from pipeline.stages.clean import clean
from pipeline.stages.load import load
from pipeline.stages.resample import working_edge_mm
from service.demo import arch as demo_arch
from tests.conftest import data_folder
from tests.support import shapes
from tests.support.retriangulated import retriangulated

DESIGNS = (
    *(
        "dental/arch_001C.ply",
        "dental/arch_022C.ply",
        "dental/arch_h1.obj",
        "dental/cast_lower_a.obj",
        "dental/molar_B03.obj",
    ),
    *("dental/ofj_tooth_19.stl", "cad/nist_am_artifact.stl", "cad/so101_base.stl", "cad/so101_upper_arm.stl"),
    *(
        "cad/featuretype.stl",
        "cad/fandisk.obj",
        "scans/rocker_arm.obj",
        "scans/stanford_bunny.obj",
        "scans/fertility.off",
    ),
)
PAIRS = ("pendulum", "separator", "square_peg")
STRANGERS = (
    ("dental/arch_001C.ply", "dental/arch_022C.ply"),
    ("cad/so101_base.stl", "cad/so101_upper_arm.stl"),
)
NOISE_SHARE, WARP_SHARE = 0.001, 0.003
SCAN_VERTICES = 8000


@dataclass(frozen=True, slots=True)
class Case:
    """truths : equivalent T_design_scan, none for a part that is not the design"""

    name: str
    design: Mesh
    scan: Mesh
    truths: list[FloatArray]


def read(path: Path) -> Mesh:
    loaded = load(pipeline.MeshFile(path), "mesh", LoadSettings(), needs_surface=False)
    return clean(loaded.mesh, "mesh", CleanSettings()).mesh


def printed(design: Mesh, seed: int, crop: float = 0.0) -> tuple[Mesh, FloatArray]:
    """A scan of a print of `design`, and T_design_scan."""
    rng = np.random.default_rng(seed)
    area = float(design.face_areas_mm2().sum())
    copy = retriangulated(design, working_edge_mm(area, SCAN_VERTICES))
    size = design.diagonal_mm
    wave = rng.normal(size=(3, 3)) * 1.4 * np.pi / size
    warp = np.sin((copy.vertices - copy.vertices.mean(axis=0)) @ wave.T) * WARP_SHARE * size / np.sqrt(3)
    noise = rng.normal(0, NOISE_SHARE * size, len(copy.vertices))[:, None] * copy.vertex_normals()
    along = copy.vertices @ rng.normal(size=3)
    kept = (along >= np.quantile(along, crop))[copy.faces].all(axis=1)
    scan = clean(Mesh(copy.vertices + warp + noise, copy.faces[kept]), "scan", CleanSettings()).mesh
    T_scan_design = shapes.motion(seed, translation_mm=size)
    return scan.moved(T_scan_design), rigid.inverse(T_scan_design)


def cases() -> Iterator[Case]:
    arch = demo_arch.arch()
    designs = {"arch by formula": Mesh(arch.vertices, arch.faces), "blob by formula": shapes.bumpy_blob(5)}
    data = data_folder()
    if data is not None:
        designs |= {Path(name).stem: read(data / name) for name in DESIGNS}
    for seed, (name, design) in enumerate(designs.items()):
        for crop in (0.0, 0.3):
            scan, truth = printed(design, seed, crop)
            yield Case(f"{name}, {crop:.0%} cut off" if crop else name, design, scan, [truth])
    if data is None:
        return
    for name in PAIRS:
        folder = data / "pairs" / name
        poses = json.loads((folder / "gt.json").read_text())["T_scan_from_cad"]
        truths = [np.linalg.inv(np.array(pose)) for pose in poses]
        for kind in ("mesh", "points"):
            scan = read(folder / f"scan_mm_{kind}.ply")
            yield Case(f"{name}, depth camera {kind}", read(folder / "cad_mm.stl"), scan, truths)
    for seed, (first, second) in enumerate(STRANGERS):
        design, other = read(data / first), read(data / second)
        scan, _ = printed(Mesh(other.vertices * design.diagonal_mm / other.diagonal_mm, other.faces), seed)
        yield Case(f"{Path(second).stem} on {Path(first).stem}", design, scan, [])


def save(mesh: Mesh, path: Path) -> Path:
    kind = (
        trimesh.PointCloud(mesh.vertices)
        if mesh.is_cloud
        else trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
    )
    kind.export(path)
    return path


def main() -> None:
    pipeline.preload()
    console = Console(width=130)
    table = Table("case", "verdict", "confidence", "error %", "RMSE %", "landmarks", "matched", "seconds")
    with tempfile.TemporaryDirectory() as folder:
        for case in cases():
            design, scan = (
                save(case.design, Path(folder) / "design.ply"),
                save(case.scan, Path(folder) / "scan.ply"),
            )
            start = time.perf_counter()
            result = pipeline.register(design, scan)
            seconds = time.perf_counter() - start
            size = case.design.diagonal_mm / 100
            error = rmse = "-"
            if result.transform is not None and result.metrics.rmse_mm is not None:
                T = np.array(result.transform.matrix)
                rmse = f"{result.metrics.rmse_mm / size:.2f}"
                if case.truths:
                    apart = [rigid.rms_displacement(T, truth, case.scan.vertices) for truth in case.truths]
                    error = f"{min(apart) / size:.2f}"
            landmarks = result.landmarks
            table.add_row(
                *(case.name, result.verdict.status, f"{result.verdict.confidence:.2f}", error, rmse),
                *(
                    f"{len(landmarks.design)} / {len(landmarks.scan)}",
                    str(len(landmarks.matches)),
                    f"{seconds:.1f}",
                ),
            )
            console.print(f"{case.name}: {result.verdict.status}, error {error} %, {seconds:.1f} s")
    console.print(table)


if __name__ == "__main__":
    main()
