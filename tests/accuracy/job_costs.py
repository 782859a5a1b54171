"""What whole jobs cost, by a call of the library: seconds, CPU seconds, memory:
`python -m tests.accuracy.job_costs`

`--against PYTHON` also runs every case with the `pipeline` that another interpreter finds (the version
before, in an environment of its own), in turns. "known": the design was analysed
before; "new": it was not; "pose": a known design and no files. Medians of `--repeats` runs in one process,
after the imports.
"""

import argparse
import json
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from pipeline.core.mesh import Mesh
from service.demo import arch as demo_arch
from tests.accuracy.bench import printed, read, save
from tests.accuracy.dense_scans import dense, noisy
from tests.accuracy.gauntlet_scans import printed as printed_under
from tests.accuracy.gauntlet_specs import CONDITIONS
from tests.support import shapes
from tests.support.data import data_folder

#: Triangles of the scan of the CAD arm, and of the large scans; both are made by subdivision.
DENSE, LARGE = 150_000, 1_000_000
#: Runs in an interpreter of its own, which may be of another version: only the public API.
PROGRAM = """
import json, resource, shutil, sys, tempfile, time
from pathlib import Path
import pipeline
pipeline.preload()
kind, design, scan, repeats = sys.argv[1], sys.argv[2], sys.argv[3], int(sys.argv[4])
rows, status = [], ""
with tempfile.TemporaryDirectory() as folder:
    cache = Path(folder) / "design"
    if kind in ("known", "pose"):
        pipeline.register(design, scan, design_cache=cache, out=Path(folder) / "first")
    for number in range(repeats):
        out = None if kind == "pose" else Path(folder) / str(number)
        wall, cpu = time.perf_counter(), time.process_time()
        if kind == "landmarks":
            pipeline.find_landmarks(scan, out=out)
        else:
            result = pipeline.register(design, scan, out=out, design_cache=cache if kind != "new" else None)
            status = result.verdict.status
        rows.append((time.perf_counter() - wall, time.process_time() - cpu))
peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
print(json.dumps({"rows": rows, "status": status, "peak": peak}))
"""


@dataclass(frozen=True, slots=True)
class Job:
    """name : of the row; kind : known, new, pose or landmarks"""

    name: str
    kind: str
    meshes: Callable[[], tuple[Mesh, Mesh]]


Pair = tuple[Mesh, Mesh]


def on_itself(design: Mesh) -> Pair:
    return design, printed(design, 0)[0]


def rough(design: Mesh) -> Pair:
    rng = np.random.default_rng(0)
    return design, printed_under(design, design.diagonal_mm, CONDITIONS["rough"], rng).scan


def dense_scan(design: Mesh, triangles: float, noise_share: float) -> Pair:
    return design, noisy(dense(design, triangles), noise_share).moved(shapes.motion(7))


def large_arch() -> Pair:
    """By formula: a million triangles with noise as large as they are, on 200,000."""
    design, scan = demo_arch.arch(100_500), demo_arch.printed(501_500).scan
    return Mesh(design.vertices, design.faces), Mesh(scan.vertices, scan.faces)


def small_jobs() -> Iterator[Job]:
    data = data_folder()
    if data is None:
        arch = demo_arch.arch()
        design = Mesh(arch.vertices, arch.faces)
    else:
        design = read(data / "dental/arch_001C.ply")
    for kind in ("known", "new", "pose", "landmarks"):
        yield Job("arch", kind, lambda: on_itself(design))
    yield Job("rough arch", "known", lambda: rough(design))
    yield Job("sphere", "known", lambda: on_itself(shapes.icosphere(20.0, 4)))
    yield Job("pin", "known", lambda: on_itself(shapes.cylinder()))
    yield Job("gear", "known", lambda: on_itself(shapes.gear(36)))
    if data is None:
        return
    other = read(data / "dental/arch_022C.ply")
    yield Job("another arch offered", "known", lambda: (design, printed(other, 1)[0]))
    yield Job("rough cast", "known", lambda: rough(read(data / "dental/cast_lower_a.obj")))
    yield Job("plate", "known", lambda: on_itself(read(data / "cad/plate_holes.stl")))
    arm = read(data / "cad/so101_upper_arm.stl")
    yield Job("CAD arm, dense noisy scan", "known", lambda: dense_scan(arm, DENSE, 0.001))


def large_jobs() -> Iterator[Job]:
    yield Job("1M on 200k, arch by formula", "known", large_arch)
    yield Job("1M on 200k, arch by formula", "pose", large_arch)
    data = data_folder()
    if data is None:
        return
    for name in ("scans/rocker_arm.obj", "scans/stanford_bunny.obj", "cad/so101_upper_arm.stl"):
        design = read(data / name)
        for noise in (0.001, 0.003):
            yield Job(
                f"1M {Path(name).stem}, noise {noise:.1%}",
                "known",
                lambda design=design, noise=noise: dense_scan(design, LARGE, noise),  # type: ignore[misc]
            )


def measure(python: str, job: Job, design: Path, scan: Path, repeats: int) -> dict[str, Any]:
    # Away from the checkout: the folder of a script comes first in the path of modules.
    done = subprocess.run(
        [python, "-c", PROGRAM, job.kind, str(design), str(scan), str(repeats)],
        check=True,
        capture_output=True,
        text=True,
        cwd=design.parent,
    )
    told: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return told


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--against", help="interpreter of the version before")
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--large", action="store_true", help="also scans of a million triangles")
    parser.add_argument("--only", help="names that contain this")
    options = parser.parse_args()
    versions = {"now": sys.executable} | ({"before": options.against} if options.against else {})
    table = Table("job", "kind", "triangles", "version", "seconds", "CPU seconds", "peak MiB", "status")
    for job in [*small_jobs(), *(large_jobs() if options.large else ())]:
        if options.only and options.only not in f"{job.name} {job.kind}":
            continue
        meshes = job.meshes()
        with tempfile.TemporaryDirectory() as folder:
            files = [save(mesh, Path(folder) / f"{k}.ply") for k, mesh in enumerate(meshes)]
            for version, python in versions.items():
                told = measure(python, job, files[0], files[1], options.repeats)
                wall_s, cpu_s = np.median(np.array(told["rows"]), axis=0)
                row = (
                    *(job.name, job.kind, " / ".join(str(len(mesh.faces)) for mesh in meshes), version),
                    *(f"{wall_s:.2f}", f"{cpu_s:.2f}", f"{told['peak']:.0f}", told["status"]),
                )
                print(*row, sep=" | ", flush=True)
                table.add_row(*row)
    Console(width=130).print(table)


if __name__ == "__main__":
    main()
