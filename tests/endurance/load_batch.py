"""Load of one design: many scans of it, registered without files."""

import time
from pathlib import Path

from service.contract.schemas import Status
from tests.accuracy.bench import printed, save
from tests.accuracy.budgets import arches
from tests.support.running import RunningService

NO_FILES = {"settings": {"report": {"content": "none"}}}
SCANS = 4  # so many different ones, in turns


def batch(service: RunningService, folder: Path, count: int) -> dict[str, str]:
    """`count` scans of an arch of 10,000 triangles; the design is analysed before the clock starts."""
    name, (design_mesh, _) = next(iter(arches().items()))
    design = save(design_mesh, folder / "arch.ply")
    scans = [save(printed(design_mesh, seed)[0], folder / f"arch_{seed}.ply") for seed in range(SCANS)]
    client = service.client
    client.wait(client.submit(design, scans[0], NO_FILES).id, timeout_s=300)
    begun = time.perf_counter()
    ids = [client.submit(design, scans[number % SCANS], NO_FILES).id for number in range(count)]
    for each in ids:
        job = client.wait(each, timeout_s=3600, interval_s=0.2)
        assert job.status is Status.SUCCESSFUL, job
    took = time.perf_counter() - begun
    found = [client.results(each)["verdict"]["status"] for each in ids]
    words = f"{60 * count / took:.0f} a minute on two places, {found.count('ok')} of them ok"
    return {f"{count} scans of one {name}, no files": words}
