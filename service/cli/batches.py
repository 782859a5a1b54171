"""`cusp batch`: many scans of one design at once, on a service."""

from pathlib import Path
from typing import Annotated, Any

import typer

from service.cli.connection import connected
from service.cli.jobs import (
    FAIL,
    Acceptance,
    AlignmentFile,
    ReferencePairs,
    ScanAccuracy,
    Server,
    Tolerance,
)
from service.cli.options import MeshPath, Preset, SettingsFile, options_of, progress_bar
from service.client.requests import DEFAULT_SERVER
from service.contract.schemas import Batch

app = typer.Typer(help="Many scans of one design at once.", no_args_is_help=True)
BatchId = Annotated[str, typer.Argument(help="id of the batch")]


@app.command()
def submit(
    design: MeshPath,
    scans: Annotated[list[Path], typer.Argument(exists=True, dir_okay=False, help="the scans")],
    server: Server = DEFAULT_SERVER,
    wait: Annotated[bool, typer.Option("--wait", help="wait for the end, and print the table")] = False,
    serial_from_name: Annotated[
        bool, typer.Option("--serial-from-name", help="the serial number of a part is the name of its file")
    ] = False,
    preset: Preset = "default",
    tolerance_mm: Tolerance = None,
    scan_accuracy_mm: ScanAccuracy = None,
    acceptance: Acceptance = None,
    alignment: AlignmentFile = None,
    reference: ReferencePairs = None,
    settings: SettingsFile = None,
    label: Annotated[str | None, typer.Option(help="free text, to find the batch again")] = None,
) -> None:
    """Send DESIGN and SCANS. Prints the id of the batch, or with --wait its table.

    With --wait: exit code 9 if a part fails, else 1 if a job failed, else 0.

    `cusp batch submit design.stl scans/*.ply --tolerance-mm 0.2 --serial-from-name --wait`
    """
    options = options_of(
        preset=preset,
        units={},
        seed=0,
        settings=settings,
        tolerance_mm=tolerance_mm,
        scan_accuracy_mm=scan_accuracy_mm,
        acceptance=acceptance,
        alignment=alignment,
        reference=reference,
    )
    with connected(server) as client:
        sent: list[dict[str, Any]] = []
        with progress_bar() as bar:
            for scan in bar.track(scans, description="sending"):
                own = {"reference": {"serial": scan.stem[:100]}} if serial_from_name else {}
                ref = {"blob": client.put_blob(scan).id, "filename": scan.name}
                sent.append({"scan": ref, "label": scan.name[:200], **own})
        batch = client.submit_batch(design, sent, batch_label=label, **options)
        if not wait:
            typer.echo(batch.id)
            return
        with progress_bar() as bar:
            task = bar.add_task("waiting", total=batch.total)
            batch = client.wait_batch(batch.id, lambda now: bar.update(task, completed=_ended(now)))
        typer.echo(client.batch_table(batch.id), nl=False)
    if batch.by_decision.get("fail"):
        raise typer.Exit(FAIL)
    if batch.by_status.get("failed"):  # type: ignore[call-overload]
        raise typer.Exit(1)


@app.command()
def status(batch_id: BatchId, server: Server = DEFAULT_SERVER) -> None:
    """Print the state of a batch as JSON: its jobs by status, verdict and decision.

    `cusp batch status 01a2019a-6685-7220-8c73-80d9802cf568`
    """
    with connected(server) as client:
        typer.echo(client.batch(batch_id).model_dump_json(indent=1))


@app.command()
def table(batch_id: BatchId, server: Server = DEFAULT_SERVER) -> None:
    """Print a CSV row for each scan.

    `cusp batch table 01a2019a-6685-7220-8c73-80d9802cf568 > batch.csv`
    """
    with connected(server) as client:
        typer.echo(client.batch_table(batch_id), nl=False)


@app.command()
def cancel(batch_id: BatchId, server: Server = DEFAULT_SERVER) -> None:
    """Cancel every job that has not ended; results are kept.

    `cusp batch cancel 01a2019a-6685-7220-8c73-80d9802cf568`
    """
    with connected(server) as client:
        typer.echo(client.cancel_batch(batch_id).model_dump_json(indent=1))


@app.command()
def retry(batch_id: BatchId, server: Server = DEFAULT_SERVER) -> None:
    """Start a new job for each scan whose job failed.

    `cusp batch retry 01a2019a-6685-7220-8c73-80d9802cf568`
    """
    with connected(server) as client:
        typer.echo(client.retry_batch(batch_id).model_dump_json(indent=1))


@app.command("list")
def list_batches(
    server: Server = DEFAULT_SERVER,
    label: Annotated[str | None, typer.Option(help="only those with this label")] = None,
) -> None:
    """Print the newest batches, one in a line: id, status, finished jobs, label.

    `cusp batch list --label night`
    """
    with connected(server) as client:
        for each in client.batches(label):
            typer.echo(
                f"{each.id}  {each.status:8}  {_ended(each)}/{each.total}  {each.label or ''}".rstrip()
            )


def _ended(batch: Batch) -> int:
    return sum(count for status, count in batch.by_status.items() if status.is_final)
