"""Load of status requests at a fixed rate, while jobs keep both cores busy."""

import asyncio
import time
from pathlib import Path

import numpy as np
import psutil

from service.contract.schemas import Status
from tests.endurance.load_jobs import keep_both_places_busy
from tests.support.running import RunningService

CONNECTIONS = 16


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
    ids = keep_both_places_busy(service, design, scan)
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
