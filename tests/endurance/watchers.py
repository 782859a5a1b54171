"""Event streams on one job, and polls beside them: how long does a poll take?

    python -m tests.endurance.watchers [--watchers 2000] [--polls 300] [--seconds 10] [--postgres]

One API process on SQLite, or on a PostgreSQL server of its own, and clients that speak plain HTTP over
sockets, since a client library costs more than the service. The job's progress changes five times a second,
and every stream must end with its last state.
"""

import argparse
import asyncio
import os
import subprocess
import sys
import tempfile
import time
from contextlib import ExitStack, suppress
from pathlib import Path

import psutil
from pydantic import SecretStr

from service.contract.schemas import Status
from service.jobs.models import JobRow, new_id
from service.jobs.store import JobStore
from service.settings import ServiceSettings
from service.storage.database import migrate, open_database
from tests.support.storage import free_port, running_postgres

CHANGES_PER_S = 5
SERVER = """
from service.api.server import run_api
from service.logs import set_up_logs
from service.settings import ServiceSettings
settings = ServiceSettings()
set_up_logs(settings, "api")
raise SystemExit(run_api(settings))
"""


async def watch(port: int, job_id: str, begun: list[int]) -> bytes:
    """The last event of a stream. begun : gets an entry when the first event came"""
    reader, writer = await asyncio.open_connection("127.0.0.1", port)
    writer.write(f"GET /v1/jobs/{job_id}/events HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n".encode())
    last = b""
    while line := await reader.readline():
        if line.startswith(b"data: "):
            begun += [] if last else [1]
            last = line
        if b'"dismissed"' in line:
            break
    writer.close()
    return last


async def poll(port: int, job_id: str, stop: asyncio.Event, every_s: float, took: list[float]) -> None:
    """Poll on one connection that is kept."""
    reader, writer = await asyncio.open_connection("127.0.0.1", port)
    request = f"GET /v1/jobs/{job_id} HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n".encode()
    while not stop.is_set():
        begun = time.perf_counter()
        writer.write(request)
        head = await reader.readuntil(b"\r\n\r\n")
        assert head.startswith(b"HTTP/1.1 200"), head
        length = int(head.lower().split(b"content-length: ")[1].split(b"\r\n")[0])
        await reader.readexactly(length)
        took.append(time.perf_counter() - begun)
        await asyncio.sleep(max(0.0, every_s - took[-1]))
    writer.close()


async def measure(
    api: psutil.Process, port: int, jobs: JobStore, job_id: str, watchers: int, polls: int, seconds: float
) -> None:
    """Print the times of polls without and with the watchers, and what the API spent of the processor.

    The processor's time depends little on what else the machine does; the times of polls do.
    """
    connections = 30
    for count in (0, watchers):
        begun: list[int] = []
        streams = [asyncio.create_task(watch(port, job_id, begun)) for _ in range(count)]
        while len(begun) < count:
            await asyncio.sleep(0.1)
        stop, took = asyncio.Event(), list[float]()
        spent = sum(api.cpu_times()[:2])
        every_s = connections / polls
        pollers = [asyncio.create_task(poll(port, job_id, stop, every_s, took)) for _ in range(connections)]
        for number in range(int(seconds * CHANGES_PER_S)):
            progress = {"stage": "matching", "progress": float(number % 100), "message": f"{number}"}
            await asyncio.to_thread(jobs.beat, job_id, 1, **progress)
            await asyncio.sleep(1 / CHANGES_PER_S)
        stop.set()
        await asyncio.gather(*pollers)
        spent = sum(api.cpu_times()[:2]) - spent
        took.sort()
        shown = {share: 1000 * took[int(share * (len(took) - 1))] for share in (0.5, 0.95, 0.99)}
        words = ", ".join(f"p{round(100 * share)} {value:.1f} ms" for share, value in shown.items())
        print(
            f"{count} watchers, {len(took) / seconds:.0f} polls/s: {words}; "
            f"API {1000 * spent / len(took):.2f} CPU ms a poll; "
            f"load of the machine {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores"
        )
        if count:
            await asyncio.to_thread(jobs.dismiss, job_id, Status.RUNNING)
            last = await asyncio.wait_for(asyncio.gather(*streams), 60)
            print(f"{sum(b'dismissed' in each for each in last)} of {count} streams heard of the end")


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--watchers", type=int, default=2000)
    parser.add_argument("--polls", type=int, default=300)
    parser.add_argument("--seconds", type=float, default=10.0)
    parser.add_argument("--postgres", action="store_true")
    given = parser.parse_args()
    with ExitStack() as stack:
        folder = stack.enter_context(tempfile.TemporaryDirectory())
        database = stack.enter_context(running_postgres()).create("watched") if given.postgres else ""
        settings = ServiceSettings(
            data_dir=Path(folder), port=free_port(), rate_limit_per_s=0, database_url=SecretStr(database)
        )
        settings.make_folders()
        migrate(settings.database)
        jobs = JobStore(open_database(settings.database))
        row = JobRow(id=new_id(), tenant="default", type="registration", inputs={}, options={})
        row.attempt, row.crashes, row.progress = 0, 0, 0.0
        jobs.add(row)
        jobs.claim(row.id, "worker-1")
        server = subprocess.Popen(
            [sys.executable, "-c", SERVER], env={**os.environ, **settings.environment()}
        )
        try:
            asyncio.run(_ready(settings.port))
            api = psutil.Process(server.pid)
            asyncio.run(measure(api, settings.port, jobs, row.id, given.watchers, given.polls, given.seconds))
            cpu = os.times()
            print(f"this process: {cpu.user + cpu.system:.1f} CPU s")
        finally:
            server.terminate()
            server.wait()


async def _ready(port: int) -> None:
    for _ in range(600):
        with suppress(OSError):
            _, writer = await asyncio.open_connection("127.0.0.1", port)
            writer.close()
            return
        await asyncio.sleep(0.1)
    raise AssertionError("the API does not start")


if __name__ == "__main__":
    main()
