"""Seconds and memory of whole jobs through the service, POST to result: `python -m tests.accuracy.budgets`

Two dental arches of 10,000 triangles, the first and the second scan of a design; with `--large` also a scan
of a million triangles on a design of 200,000. With CUSP_DATA real arches, else the demo's. Overhead: POST to
result, less the stages' own seconds.
"""

import argparse
import statistics
import tempfile
import time
from pathlib import Path

import numpy as np
import psutil
from prometheus_client.parser import text_string_to_metric_families
from rich.console import Console
from rich.table import Table

from pipeline.core.mesh import Mesh
from service.client.sync import Client
from service.demo import arch as demo_arch
from tests.accuracy.bench import printed, read, save
from tests.conftest import data_folder
from tests.support.running import RunningService

ARCHES = ("arch_001C", "arch_012C", "arch_022C")
DESIGN_VERTICES, SCAN_VERTICES = 100_500, 501_500  # of the large pair: twice as many triangles


def arches() -> dict[str, tuple[Mesh, Mesh]]:
    """Design and scan of about 10,000 triangles each."""
    data = data_folder()
    if data is None:
        design, scan = demo_arch.arch(), demo_arch.printed().scan
        return {"demo arch": (Mesh(design.vertices, design.faces), Mesh(scan.vertices, scan.faces))}
    designs = {name: read(data / "dental" / f"{name}.ply") for name in ARCHES}
    return {name: (design, printed(design, seed)[0]) for seed, (name, design) in enumerate(designs.items())}


def large() -> tuple[Mesh, Mesh]:
    """An arch by formula and the scan of its print."""
    design, scan = demo_arch.arch(DESIGN_VERTICES), demo_arch.printed(SCAN_VERTICES).scan
    return Mesh(design.vertices, design.faces), Mesh(scan.vertices, scan.faces)


def peak_mib(client: Client) -> float:
    """The most that a job's process took so far; the service counts it when the process ends."""
    told = client._http.get("/metrics").text
    found = {each.name: each.samples for each in text_string_to_metric_families(told)}
    return max(float(sample.value) for sample in found["cusp_child_peak_mib"])


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--large", action="store_true", help="also a million triangles")
    parser.add_argument("--scans", type=int, default=3, help="of each design")
    options = parser.parse_args()
    pairs = arches() | ({"large": large()} if options.large else {})
    table = Table(title="Whole jobs through the service, seconds")
    for column in (
        "design",
        "triangles",
        "scan",
        "POST to result",
        "overhead",
        "registration",
        "verdict",
        "RMSE mm",
    ):
        table.add_column(column)
    overheads: list[float] = []
    with tempfile.TemporaryDirectory() as folder:
        service = RunningService(Path(folder) / "data")
        try:
            for name, (design, scan) in pairs.items():
                files = save(design, Path(folder) / "design.ply"), save(scan, Path(folder) / "scan.ply")
                for number in range(options.scans):
                    begun = time.perf_counter()
                    result = service.client.register(*files).result()
                    took = time.perf_counter() - begun
                    overheads.append(took - sum(result.timings_s.values()))
                    which = "first of the design" if number == 0 else "next"
                    slowest = sorted(result.timings_s.items(), key=lambda each: -each[1])[:4]
                    print(f"{name} {which}: {took:.2f} s; " + ", ".join(f"{k} {v:.2f}" for k, v in slowest))
                    table.add_row(
                        *(name, f"{len(design.faces)} / {len(scan.faces)}", which, f"{took:.2f}"),
                        *(
                            f"{overheads[-1]:.2f}",
                            f"{result.timings_s['registration']:.2f}",
                            result.verdict.status,
                        ),
                        f"{np.nan if result.metrics.rmse_mm is None else result.metrics.rmse_mm:.3f}",
                    )
            peak = peak_mib(service.client)
        finally:
            service.stop()
    console = Console(width=140)
    console.print(table)
    console.print(
        f"overhead of a job: median {statistics.median(overheads):.2f} s; most memory of a job's process: "
        f"{peak:.0f} MiB; "
        f"{psutil.cpu_count()} cores"
    )


if __name__ == "__main__":
    main()
