"""How the service bears load: `python -m tests.endurance.load`

Polling at a fixed rate while jobs keep both cores busy; a 300 MB upload; 10,000 waiting jobs listed, paged
and dismissed; 1,000 small jobs done; scans of one design. The load comes from this process, on the same
cores: its own share is in the table.
"""

import argparse
import json
import tempfile
from collections.abc import Callable
from pathlib import Path

from rich.console import Console
from rich.table import Table

from tests.endurance.load_batch import batch
from tests.endurance.load_jobs import drain, overhead, queue
from tests.endurance.load_polling import polling
from tests.endurance.load_upload import upload
from tests.support.meshes import blob_stl
from tests.support.running import RunningService


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--rate", type=float, default=300)
    parser.add_argument("--seconds", type=float, default=30)
    parser.add_argument("--mib", type=int, default=300)
    parser.add_argument("--queued", type=int, default=10_000)
    parser.add_argument("--small", type=int, default=1_000)
    parser.add_argument("--arches", type=int, default=100)
    parser.add_argument("--only", help="of: overhead polling upload queue drain batch, with commas between")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        design, scan = folder / "design.stl", folder / "scan.stl"
        design.write_bytes(blob_stl())
        scan.write_bytes(blob_stl(23, 37, turn_deg=25.0, shift_mm=(4.0, -3.0, 2.0)))
        service = RunningService(
            folder / "data", CUSP_JOBS="2", CUSP_LOG_LEVEL="warning", CUSP_RATE_LIMIT_PER_S="0"
        )
        steps: dict[str, Callable[[], dict[str, str]]] = {
            "overhead": lambda: overhead(service, design, scan),
            "upload": lambda: upload(service, folder, options.mib),
            "polling": lambda: polling(service, design, scan, options.rate, options.seconds),
            "queue": lambda: queue(service, design, scan, options.queued),
            "drain": lambda: drain(service, options.small),
            "batch": lambda: batch(service, folder, options.arches),
        }
        wanted = options.only.split(",") if options.only else list(steps)
        table = Table("what", "measured")
        try:
            for name in wanted:
                for what, words in steps[name]().items():
                    table.add_row(what, words)
                    print(json.dumps({what: words}), flush=True)
        finally:
            service.stop()
        Console().print(table)


if __name__ == "__main__":
    main()
