"""How the service bears load: `python -m tests.endurance.load`

Polling at a fixed rate while jobs keep both cores busy; a 300 MB upload; 10,000 waiting jobs listed, paged
and dismissed; 1,000 small jobs done. The load comes from this process, on the same cores: its own share is in
the table. Longer than other files: four measurements that share one service and one table.
"""

import argparse
import asyncio
import http.client
import json
import struct
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import psutil
from rich.console import Console
from rich.table import Table

from service.contract.schemas import Status
from tests.support.meshes import blob_stl
from tests.support.running import QUICK, RunningService, wait_until
from tests.support.shapes import icosphere

CONNECTIONS = 16
MIB = 1024 * 1024
BUSY = {"settings": {"resample": {"target_vertices": 20_000}}}  # minutes of work
SMALL = {
    "settings": {
        "resample": {"target_vertices": 200},
        "features": {"target_vertices": 300},
        "report": {"write_files": False},
    }
}


async def poll(port: int, path: str, rate: float, seconds: float) -> list[float]:
    """Latencies, from when each request was due: a server that is late is not excused (no coordinated
    omission).
    """
    request = f"GET {path} HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n".encode()
    begun = time.perf_counter()
    count = int(rate * seconds)
    latencies: list[float] = []

    async def connection(first: int) -> None:
        reader, writer = await asyncio.open_connection("127.0.0.1", port)
        for number in range(first, count, CONNECTIONS):
            due = begun + number / rate
            await asyncio.sleep(max(0.0, due - time.perf_counter()))
            writer.write(request)
            head = await reader.readuntil(b"\r\n\r\n")
            assert head.startswith(b"HTTP/1.1 200"), head
            length = int(head.lower().partition(b"content-length: ")[2].partition(b"\r\n")[0])
            await reader.readexactly(length)
            latencies.append(time.perf_counter() - due)
        writer.close()

    await asyncio.gather(*(connection(first) for first in range(CONNECTIONS)))
    return latencies


def polling(service: RunningService, design: Path, scan: Path, rate: float, seconds: float) -> dict[str, str]:
    """Two jobs compute all the while."""
    ids = [service.client.submit(design, scan, BUSY).id for _ in range(2)]
    wait_until(lambda: len(service.job_processes()) == 2, 60, "two jobs to compute")
    children, api, own = service.job_processes(), service.part("api"), psutil.Process()
    parts = {"API": [api], "this load": [own], "jobs": children, "worker": [service.part("worker")]}
    before = {name: sum(sum(each.cpu_times()[:2]) for each in group) for name, group in parts.items()}
    begun = time.perf_counter()
    latencies = np.array(asyncio.run(poll(service.port, f"/v1/jobs/{ids[0]}", rate, seconds)))
    took = time.perf_counter() - begun
    shares = {
        name: (sum(sum(each.cpu_times()[:2]) for each in group) - before[name]) / took
        for name, group in parts.items()
    }
    assert all(service.client.job(each).status is Status.RUNNING for each in ids), "the jobs ended too early"
    for each in ids:
        service.client.dismiss(each)
    p50, p95, p99, most = (f"{1000 * np.quantile(latencies, q):.1f}" for q in (0.5, 0.95, 0.99, 1.0))
    return {
        "status requests": f"{len(latencies)} at {len(latencies) / took:.0f} a second",
        "p50, p95, p99, most (ms)": f"{p50}, {p95}, {p99}, {most}",
        "cores used": ", ".join(f"{name} {share:.2f}" for name, share in shares.items()),
    }


class Watch:
    """The most resident memory of a process while inside, looked at every 10 ms."""

    def __init__(self, process: psutil.Process) -> None:
        self._process, self._stop = process, threading.Event()
        self.before = process.memory_info().rss / MIB
        self.peak = self.before
        self._thread = threading.Thread(target=self._look)

    def _look(self) -> None:
        while not self._stop.wait(0.01):
            self.peak = max(self.peak, self._process.memory_info().rss / MIB)

    def __enter__(self) -> "Watch":
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stop.set()
        self._thread.join()


def big_stl(path: Path, mib: int) -> int:
    """A binary STL of this size; nobody will parse it."""
    count = (mib * MIB - 84) // 50
    block = np.random.default_rng(0).bytes(50 * 20_000)
    with path.open("wb") as file:
        file.write(b"\0" * 80 + struct.pack("<I", count))
        for _ in range(count // 20_000):
            file.write(block)
        file.write(block[: 50 * (count % 20_000)])
    return path.stat().st_size


def upload(service: RunningService, folder: Path, mib: int) -> dict[str, str]:
    """The same file as a raw body, and in a form."""
    path = folder / "big.stl"
    size = big_stl(path, mib)
    api = service.part("api")
    with Watch(api) as raw, path.open("rb") as body:
        begun = time.perf_counter()
        connection = http.client.HTTPConnection("127.0.0.1", service.port, timeout=300)
        connection.request("PUT", "/v1/blobs", body=body, headers={"Content-Length": str(size)})
        answer = connection.getresponse()
        assert answer.status == 200, answer.read()
        answer.read()
        connection.close()
        raw_s = time.perf_counter() - begun
    boundary = "cusp-boundary"
    head = f'--{boundary}\r\nContent-Disposition: form-data; name="mesh"; filename="big.stl"\r\n\r\n'.encode()
    kind = (
        f'\r\n--{boundary}\r\nContent-Disposition: form-data; name="type"\r\n\r\n'
        f"landmarks\r\n--{boundary}--\r\n"
    ).encode()

    def form() -> Iterator[bytes]:
        yield head
        with path.open("rb") as body:
            while chunk := body.read(MIB):
                yield chunk
        yield kind

    with Watch(api) as multipart:
        begun = time.perf_counter()
        sent = httpx.post(
            f"http://127.0.0.1:{service.port}/v1/jobs",
            content=form(),
            headers={
                "Content-Type": f"multipart/form-data; boundary={boundary}",
                "Content-Length": str(len(head) + size + len(kind)),
            },
            timeout=300,
        )
        form_s = time.perf_counter() - begun
    assert sent.status_code == 202, sent.text
    service.client.dismiss(sent.json()["id"])
    return {
        f"{mib} MiB by PUT": (
            f"{raw_s:.1f} s; API resident {raw.before:.0f} MiB before, at most {raw.peak:.0f}"
        ),
        f"{mib} MiB in a form": f"{form_s:.1f} s; at most {multipart.peak:.0f} MiB",
    }


def timed(act: Callable[[], Any]) -> tuple[float, Any]:
    begun = time.perf_counter()
    got = act()
    return time.perf_counter() - begun, got


def put(http_client: httpx.Client, content: bytes, name: str) -> dict[str, str]:
    return {
        "blob": http_client.put("/v1/blobs", content=content, params={"filename": name}).json()["id"],
        "filename": name,
    }


def queue(service: RunningService, design: Path, scan: Path, count: int) -> dict[str, str]:
    """Both places are taken while `count` jobs wait."""
    blockers = [service.client.submit(design, scan, BUSY).id for _ in range(2)]
    wait_until(lambda: len(service.job_processes()) == 2, 60, "two jobs to compute")
    with httpx.Client(base_url=service.client.server, timeout=60) as client:
        mesh = put(client, small_mesh(), "s.stl")
        body = {"type": "landmarks", "mesh": mesh, "options": SMALL}
        sent_s, answers = timed(lambda: [client.post("/v1/jobs", json=body) for _ in range(count)])
        assert {each.status_code for each in answers} == {202}
        first_s, _ = timed(lambda: client.get("/v1/jobs", params={"limit": 50}).raise_for_status())

        def all_pages() -> list[str]:
            ids: list[str] = []
            cursor: str | None = None
            while True:
                words = {"status": "accepted", "limit": 1000} | ({"cursor": cursor} if cursor else {})
                page = client.get("/v1/jobs", params=words).raise_for_status().json()
                ids += [each["id"] for each in page["jobs"]]
                cursor = page["next"]
                if cursor is None:
                    return ids

        paged_s, ids = timed(all_pages)
        assert len(ids) == len(set(ids)) == count, len(ids)
        dismissed_s, gone = timed(lambda: {client.delete(f"/v1/jobs/{each}").status_code for each in ids})
        assert gone == {204}
        for each in blockers:
            service.client.dismiss(each)
        begun = time.perf_counter()
        after = client.post("/v1/jobs", json=body).json()["id"]
        service.client.wait(after, timeout_s=300)
        return {
            f"{count} jobs sent": f"{sent_s:.0f} s, {count / sent_s:.0f} a second",
            "page of 50 among them": f"{1000 * first_s:.0f} ms",
            "all, in pages of 1000": f"{paged_s:.2f} s",
            "all dismissed": f"{dismissed_s:.0f} s",
            "a new job after that": f"done in {time.perf_counter() - begun:.1f} s",
        }


def small_mesh() -> bytes:
    mesh = icosphere(10.0, 2)
    corners = (mesh.vertices * [1.0, 0.8, 0.6])[mesh.faces].astype("<f4")
    records = np.zeros(
        len(corners), dtype=[("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("rest", "<u2")]
    )
    records["corners"] = corners
    return b"\0" * 80 + struct.pack("<I", len(corners)) + records.tobytes()


def drain(service: RunningService, count: int) -> dict[str, str]:
    """Small jobs from the first POST to the end of the last."""
    with httpx.Client(base_url=service.client.server, timeout=60) as client:
        body = {"type": "landmarks", "mesh": put(client, small_mesh(), "s.stl"), "options": SMALL}
        begun = time.perf_counter()
        ids = [client.post("/v1/jobs", json=body).json()["id"] for _ in range(count)]
        for each in ids:
            job = service.client.wait(each, timeout_s=1800, interval_s=0.5)
            assert job.status is Status.SUCCESSFUL, job
        took = time.perf_counter() - begun
        worked = [client.get(f"/v1/jobs/{each}/results").json()["timings_s"] for each in ids[:50]]
        own = float(np.median([sum(value for value in each.values() if value) for each in worked]))
    words = f"{took:.0f} s, {1000 * took / count:.0f} ms a job on two places; "
    words += f"its own stages take {1000 * own:.0f} ms"
    return {f"{count} small jobs done": words}


def overhead(service: RunningService, design: Path, scan: Path) -> dict[str, str]:
    """From POST to final, less what the stages took, of jobs alone on the machine."""
    over = []
    for _ in range(10):
        begun = time.perf_counter()
        job_id = service.client.submit(design, scan, QUICK).id
        service.client.wait(job_id, timeout_s=60, interval_s=0.01)
        took = time.perf_counter() - begun
        timings = service.client.results(job_id)["timings_s"]
        over.append(took - sum(value for value in timings.values() if value))
    return {
        "overhead of a job, median of 10": (
            f"{1000 * float(np.median(over)):.0f} ms (max {1000 * max(over):.0f})"
        )
    }


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--rate", type=float, default=300)
    parser.add_argument("--seconds", type=float, default=30)
    parser.add_argument("--mib", type=int, default=300)
    parser.add_argument("--queued", type=int, default=10_000)
    parser.add_argument("--small", type=int, default=1_000)
    parser.add_argument("--only", help="of: overhead polling upload queue drain, with commas between")
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
