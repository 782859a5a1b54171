"""The Python client, waiting and async, against a whole service; and over a line that loses answers."""

import asyncio
import socket
import threading
from collections.abc import Iterator
from contextlib import closing, contextmanager, suppress
from pathlib import Path

import pytest

from pipeline import LandmarksResult, RegistrationResult
from service.client.aio import AsyncClient
from service.client.sync import Client, ServiceProblem, ServiceUnreachable, register
from service.contract.schemas import Status
from tests.support.running import LONG, QUICK, RunningService

pytestmark = pytest.mark.e2e
SETTINGS = QUICK["settings"]
BUSY = b"HTTP/1.1 503 Busy\r\nRetry-After: 0\r\nContent-Length: 4\r\nConnection: close\r\n\r\nbusy"


@contextmanager
def bad_line(port: int, faults: list[str]) -> Iterator[str]:
    """The address of a proxy to the service. The first connections meet `faults`: "lost": the service answers
    and nobody hears it; "busy": the proxy itself answers 503.
    """
    listener = socket.create_server(("127.0.0.1", 0))

    def serve(client: socket.socket, fault: str | None) -> None:
        with closing(client), closing(socket.create_connection(("127.0.0.1", port))) as service:
            if fault == "busy":
                client.recv(1 << 16)
                client.sendall(BUSY)
                return

            def forth() -> None:
                with suppress(OSError):
                    while data := client.recv(1 << 16):
                        service.sendall(data)

            threading.Thread(target=forth, daemon=True).start()
            with suppress(OSError):
                while data := service.recv(1 << 16):
                    if fault == "lost":
                        client.shutdown(socket.SHUT_RDWR)  # wakes `forth`
                        return
                    client.sendall(data)

    def accept() -> None:
        with suppress(OSError):
            while True:
                client, _ = listener.accept()
                fault = faults.pop(0) if faults else None
                threading.Thread(target=serve, args=(client, fault), daemon=True).start()

    threading.Thread(target=accept, daemon=True).start()
    try:
        yield f"http://127.0.0.1:{listener.getsockname()[1]}"
    finally:
        listener.shutdown(socket.SHUT_RDWR)
        listener.close()


def test_one_line_registers(running: RunningService, design: Path, scan: Path, tmp_path: Path) -> None:
    job = register(
        design, str(scan), server=running.client.server, settings=SETTINGS, tolerance_mm=0.5, label="one line"
    )
    result = job.result(timeout_s=240)
    assert isinstance(result, RegistrationResult)
    assert (
        result.verdict.status == "ok"
        and result.deviation is not None
        and result.deviation.tolerance_mm == 0.5
    )
    files = job.download(tmp_path / "out")
    assert {path.name for path in files} == {*result.files} and (
        tmp_path / "out" / "report.html"
    ).stat().st_size > 10_000
    assert running.client.job(job.id).label == "one line"


def test_a_design_is_sent_once(running: RunningService, design: Path, scan: Path) -> None:
    blob = running.client.put_blob(design)
    result = running.client.register(blob, scan, settings=SETTINGS).result(240)
    assert result.provenance.inputs.design.sha256 == blob.id.removeprefix("sha256:")
    assert isinstance(running.client.landmarks(blob, settings=SETTINGS).result(240), LandmarksResult)
    study = running.client.study(blob, settings=SETTINGS, study={"trials": 5, "detectors": ["t2"]}).result(
        240
    )
    assert study.protocol.trials == 5


def test_many_jobs_are_awaited_together(
    running: RunningService, design: Path, scan: Path, tmp_path: Path
) -> None:
    async def all_of_them() -> list[RegistrationResult]:
        async with AsyncClient(running.client.server) as cusp:
            blob = await cusp.put_blob(design)
            jobs = [await cusp.register(blob, scan, settings=SETTINGS, seed=seed) for seed in range(2)]
            found = await asyncio.gather(*(job.result(timeout_s=240) for job in jobs))
            await jobs[0].download(tmp_path)
            with pytest.raises(ServiceProblem, match="job_not_found"):
                await cusp.job("no-such-job")
            return found

    results = asyncio.run(all_of_them())
    assert [result.verdict.status for result in results] == ["ok"] * 2
    assert [result.provenance.seed for result in results] == [0, 1]
    assert (tmp_path / "results.json").exists()


def test_an_answer_that_was_lost_starts_no_second_job(
    running: RunningService, design: Path, scan: Path
) -> None:
    with bad_line(running.port, ["lost", "busy", "lost"]) as address, Client(address) as client:
        job = client.register(design, scan, settings=SETTINGS, label="over a bad line")
        assert job.result(240).verdict.status == "ok"
    answer = running.client._http.get("/v1/jobs", params={"label": "over a bad line"})
    assert [each["id"] for each in answer.json()["jobs"]] == [job.id]

    async def the_same() -> str:
        with bad_line(running.port, ["busy", "lost", "lost"]) as address:
            async with AsyncClient(address) as cusp:
                return (await cusp.landmarks(design, settings=SETTINGS, label="over a bad line, async")).id

    job_id = asyncio.run(the_same())
    answer = running.client._http.get("/v1/jobs", params={"label": "over a bad line, async"})
    assert [each["id"] for each in answer.json()["jobs"]] == [job_id]


def test_patience_ends(design: Path, scan: Path) -> None:
    with (
        Client("http://127.0.0.1:9", patience_s=0.5) as client,
        pytest.raises(ServiceUnreachable, match="cusp up"),
    ):
        client.register(design, scan)


def test_a_wrong_option_and_a_dismissed_job_are_problems(
    running: RunningService, design: Path, scan: Path
) -> None:
    with pytest.raises(ServiceProblem, match="invalid_options"):
        running.client.register(design, scan, settings={"segmentation": {"quantil": 1}})
    job = running.client.register(design, scan, settings=LONG["settings"])
    with pytest.raises(TimeoutError, match="not final"):
        job.result(timeout_s=0.2)
    job.dismiss()
    with pytest.raises(ServiceProblem, match="job_dismissed"):
        job.result(timeout_s=20)
    assert running.client.job(job.id).status is Status.DISMISSED
    assert running.client.forecast(job.id).remaining_s == 0
