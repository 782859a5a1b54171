"""`cusp batch` and the clients, against a service in this process."""

import asyncio
from pathlib import Path

from typer.testing import CliRunner

from service.cli.main import app
from service.client import AsyncClient, Client
from tests.support.service import TRIANGLE_OBJ, Service


def run(service: Service, *arguments: str) -> str:
    done = CliRunner().invoke(app, ["batch", *arguments, "--server", str(service.http.base_url)])
    assert done.exit_code == 0, done.output
    # without what the service in this process logs
    return "\n".join(line for line in done.stdout.splitlines() if not line.startswith("["))


def test_a_batch_from_the_command_line(service: Service, tmp_path: Path) -> None:
    for name in ("design", "A-17", "A-18"):
        (tmp_path / f"{name}.obj").write_bytes(TRIANGLE_OBJ)
    meshes = [str(tmp_path / f"{name}.obj") for name in ("design", "A-17", "A-18")]
    more = ("--tolerance-mm", "0.2", "--serial-from-name", "--label", "night", "--reference", "batch=7")
    batch_id = run(service, "submit", *meshes, *more).strip()
    for job_id in list(service.waiting):
        service.worker.run(job_id)
    assert [task["tolerance_mm"] for task in service.sandbox.tasks] == [0.2, 0.2]
    assert '"finished"' in run(service, "status", batch_id)
    header, *lines = run(service, "table", batch_id).splitlines()
    assert header.startswith("index,job,label,part_number,serial,batch")
    assert [line.split(",")[4:6] for line in lines] == [["A-17", "7"], ["A-18", "7"]]
    assert run(service, "list", "--label", "night").split() == [batch_id, "finished", "2/2", "night"]
    assert batch_id in run(service, "retry", batch_id)
    assert '"successful": 2' in run(service, "cancel", batch_id)


def test_batches_and_characteristics_by_the_clients(service: Service, tmp_path: Path) -> None:
    mesh = tmp_path / "mesh.obj"
    mesh.write_bytes(TRIANGLE_OBJ)
    address = str(service.http.base_url)
    with Client(address) as client:
        design = client.put_blob(mesh)
        client.put_characteristics(design, {"tolerance_mm": 0.4})
        made = client.submit_batch(design, [mesh, {"scan": mesh, "label": "b"}], batch_label="x", seed=3)
        assert (made.total, made.label) == (2, "x")

    async def elsewhere() -> None:
        async with AsyncClient(address) as client:
            assert (await client.characteristics(design))["tolerance_mm"] == 0.4
            url = {"url": "https://files.example.com/a.obj"}
            second = await client.submit_batch(design, [url])
            assert [each.id for each in await client.batches()] == [second.id, made.id]
            assert (await client.cancel_batch(second.id)).status == "finished"
            assert (await client.retry_batch(second.id)).total == 1
            assert (await client.batch(made.id)).status == "accepted"
            assert (await client.batch_table(made.id)).count("\n") == 3
            await client.delete_characteristics(design)

    asyncio.run(elsewhere())
    for job_id in list(service.waiting):
        service.worker.run(job_id)
    assert [(task["tolerance_mm"], task["seed"]) for task in service.sandbox.tasks] == [(0.4, 3)] * 2
    with Client(address) as client:
        assert client.wait_batch(made.id).status == "finished"
