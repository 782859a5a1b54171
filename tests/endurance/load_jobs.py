"""Load of jobs: the overhead of one, thousands that wait, thousands that are done."""

import struct
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import httpx
import numpy as np

from service.contract.schemas import Status
from tests.support.running import QUICK, RunningService, wait_until
from tests.support.shapes import icosphere

BUSY = {"settings": {"resample": {"target_vertices": 20_000}}}  # minutes of work
# minutes of work
SMALL = {
    "settings": {
        "resample": {"target_vertices": 200},
        "features": {"target_vertices": 300},
        "report": {"write_files": False},
    }
}


def keep_both_places_busy(service: RunningService, design: Path, scan: Path) -> list[str]:
    """Two long jobs, once both compute."""
    ids = [service.client.submit(design, scan, BUSY).id for _ in range(2)]
    wait_until(lambda: len(service.job_processes()) == 2, 60, "two jobs to compute")
    return ids


def timed(act: Callable[[], Any]) -> tuple[float, Any]:
    begun = time.perf_counter()
    got = act()
    return time.perf_counter() - begun, got


def put(http_client: httpx.Client, content: bytes, name: str) -> dict[str, str]:
    return {
        "blob": http_client.put("/v1/blobs", content=content, params={"filename": name}).json()["id"],
        "filename": name,
    }


#: The least that a job can do: a few hundredths of a second of work.
SMALLEST = {"settings": {**SMALL["settings"], "resample": {"enabled": False}}}


def small_mesh(subdivisions: int = 2) -> bytes:
    mesh = icosphere(10.0, subdivisions)
    corners = (mesh.vertices * [1.0, 0.8, 0.6])[mesh.faces].astype("<f4")
    records = np.zeros(
        len(corners), dtype=[("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("rest", "<u2")]
    )
    records["corners"] = corners
    return b"\0" * 80 + struct.pack("<I", len(corners)) + records.tobytes()


def queue(service: RunningService, design: Path, scan: Path, count: int) -> dict[str, str]:
    """Both places are taken while `count` jobs wait."""
    blockers = keep_both_places_busy(service, design, scan)
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
