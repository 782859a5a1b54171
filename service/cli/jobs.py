"""Commands on a design and its scan, and on a service: register, submit, demo."""

import json
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console

from pipeline import MeshFile, PipelineError
from pipeline import register as register_meshes
from service.cli.options import (
    AsJson,
    MeshPath,
    Out,
    Preset,
    Seed,
    SettingsFile,
    UnitOption,
    options_of,
    progress_bar,
    refuse,
)
from service.client import DEFAULT_SERVER, Client, ServiceProblem, ServiceUnreachable
from service.client.results_table import print_results
from service.contract.design_options import check_limits
from service.contract.errors import ServiceError
from service.contract.job_types import MESHES, parse_type
from service.contract.options import parse_options, resolve_settings

#: Exit code by verdict; 1 is bad input or a job that failed, 2 a wrong command line.
EXITS = {
    "ok": 0,
    "no_match": 3,
    "mirrored": 4,
    "units_suspect": 5,
    "ambiguous": 6,
    "under_constrained": 7,
    "uncertain": 8,
}
FAIL = 9  #: exit code of a part that fails
PATIENCE_S = 2.0  # short, since a person waits

Server = Annotated[str, typer.Option(help="address of the service", envvar="CUSP_SERVER")]
Tolerance = Annotated[
    float | None, typer.Option(help="deviation up to which the surface is within tolerance")
]
ScanAccuracy = Annotated[
    float | None, typer.Option(help="accuracy of the scanner, one sigma, as its maker states it")
]
DesignPart = Annotated[
    str | None, typer.Option(help="part of a design file with several: name, number from 1, or all")
]
Acceptance = Annotated[
    Path | None,
    typer.Option(
        exists=True, dir_okay=False, help="JSON with what the part must satisfy: options.acceptance"
    ),
]
AlignmentFile = Annotated[
    Path | None,
    typer.Option(
        "--alignment",
        exists=True,
        dir_okay=False,
        help="JSON with the alignment that deviations are measured under: options.alignment",
    ),
]
ReferencePairs = Annotated[
    list[str] | None,
    typer.Option("--reference", help="KEY=VALUE, repeated: serial, batch, part_number, ... of the part"),
]
Columns = Annotated[
    str | None, typer.Option(help="columns of a scan that is a text of points: id,x,y,z or 2,3,4")
]


def register(
    design: MeshPath,
    scan: MeshPath,
    out: Out,
    preset: Preset = "default",
    tolerance_mm: Tolerance = None,
    scan_accuracy_mm: ScanAccuracy = None,
    acceptance: Acceptance = None,
    reference: ReferencePairs = None,
    alignment: AlignmentFile = None,
    design_part: DesignPart = None,
    columns: Columns = None,
    unit_design: UnitOption = "auto",
    unit_scan: UnitOption = "auto",
    seed: Seed = 0,
    settings: SettingsFile = None,
    as_json: AsJson = False,
) -> None:
    """Register SCAN to DESIGN without a server.

    Exit code 0: verdict ok; 1: bad input; 3 to 8: no_match, mirrored, units_suspect, ambiguous,
    under_constrained, uncertain; 9: the part fails its acceptance limits.

    `cusp register design.stl scan.ply --tolerance-mm 0.2 --out result`

    `cusp register design.stl scan.obj --unit-scan inch --json --out result | jq .verdict.status`
    """
    units = {"design": unit_design, "scan": unit_scan}
    options_document = options_of(
        preset=preset,
        units=units,
        seed=seed,
        settings=settings,
        tolerance_mm=tolerance_mm,
        scan_accuracy_mm=scan_accuracy_mm,
        acceptance=acceptance,
        reference=reference,
        alignment=alignment,
        design_part=design_part,
        columns=columns,
    )
    try:
        options = parse_options(options_document)
        check_limits(options)
        with progress_bar() as bar:
            task = bar.add_task("starting", total=100.0)
            result = register_meshes(
                MeshFile(design, unit=options.units.design, filename=design.name, part=options.design_part),
                MeshFile(scan, unit=options.units.scan, filename=scan.name, columns=options.columns),
                settings=resolve_settings(options),
                tolerance_mm=options.tolerance_mm,
                scan_accuracy_mm=options.scan_accuracy_mm,
                acceptance=options.acceptance,
                reference=options.reference,
                alignment=options.alignment,
                seed=options.seed,
                out=out,
                on_progress=lambda step: bar.update(task, completed=step.percent, description=step.message),
            )
    except (PipelineError, ServiceError) as error:
        refuse(error.detail)
    _conclude(json.loads(result.model_dump_json()), out, as_json)


def submit(
    meshes: Annotated[
        list[Path],
        typer.Argument(
            exists=True,
            dir_okay=False,
            readable=True,
            metavar="DESIGN SCAN | MESH",
            help="a design and its scan; one mesh for the other types",
        ),
    ],
    job_type: Annotated[
        str, typer.Option("--type", help="registration, landmarks or study")
    ] = "registration",
    server: Server = DEFAULT_SERVER,
    wait: Annotated[bool, typer.Option("--wait", help="wait for the end, and print the results")] = False,
    out: Annotated[Path | None, typer.Option(help="download the files to this folder (waits)")] = None,
    preset: Preset = "default",
    tolerance_mm: Tolerance = None,
    scan_accuracy_mm: ScanAccuracy = None,
    acceptance: Acceptance = None,
    reference: ReferencePairs = None,
    alignment: AlignmentFile = None,
    design_part: DesignPart = None,
    columns: Columns = None,
    unit_design: UnitOption = "auto",
    unit_scan: UnitOption = "auto",
    unit: Annotated[str, typer.Option(help="unit of the one mesh: auto, mm, cm, m or inch")] = "auto",
    seed: Seed = 0,
    settings: SettingsFile = None,
    label: Annotated[str | None, typer.Option(help="free text, to find the job again")] = None,
    as_json: AsJson = False,
) -> None:
    """Send DESIGN and SCAN, or one MESH, to a service. Prints the id of the job, or with --wait its results.

    With --wait, exit codes are those of register.

    `cusp submit design.stl scan.ply --wait --tolerance-mm 0.2`

    `cusp submit part.stl --type landmarks --out result`

    `CUSP_API_KEY=cusp_... cusp submit design.stl scan.ply --server https://cusp.example.com`
    """
    units = {"design": unit_design, "scan": unit_scan, "mesh": unit}
    options_document = options_of(
        preset=preset,
        units=units,
        seed=seed,
        settings=settings,
        tolerance_mm=tolerance_mm,
        scan_accuracy_mm=scan_accuracy_mm,
        acceptance=acceptance,
        reference=reference,
        alignment=alignment,
        design_part=design_part,
        columns=columns,
    )
    try:
        kind = parse_type(job_type)
        if len(meshes) != len(MESHES[kind]):
            refuse(
                f"a {kind} job takes {len(MESHES[kind])} file(s) ({' and '.join(MESHES[kind])}), "
                f"not {len(meshes)}"
            )
        scan = meshes[1] if len(meshes) > 1 else None
        with Client(server, patience_s=PATIENCE_S) as client:
            with progress_bar() as bar:
                sending = bar.add_task("sending", total=sum(mesh.stat().st_size for mesh in meshes))
                job = client.submit(
                    meshes[0],
                    scan,
                    options_document | ({"label": label} if label else {}),
                    job_type=kind,
                    on_sent=lambda count: bar.advance(sending, count),
                )
            if not wait and out is None:
                typer.echo(job.id)
                return
            with progress_bar() as bar:
                task = bar.add_task("waiting", total=100.0)
                client.wait(
                    job.id,
                    lambda now: bar.update(
                        task, completed=now.progress, description=now.message or now.status.value
                    ),
                )
            results = client.results(job.id)
            if out is not None:
                out.mkdir(parents=True, exist_ok=True)
                for file in client.files(job.id):
                    client.download(job.id, file.name, out / file.name)
    except ServiceProblem as error:
        refuse(error.problem.detail)
    except (ServiceUnreachable, ServiceError) as error:
        refuse(str(error))
    _conclude(results, out, as_json)


def demo(
    server: Server = DEFAULT_SERVER,
    data_dir: Annotated[
        Path, typer.Option(help="data folder of the service that is started if none runs")
    ] = Path("cusp-data"),
    out: Annotated[Path, typer.Option(help="folder for the meshes and the results")] = Path("cusp-demo"),
    design: Annotated[Path | None, typer.Option(exists=True, dir_okay=False, help="your design mesh")] = None,
    scan: Annotated[Path | None, typer.Option(exists=True, dir_okay=False, help="your scan mesh")] = None,
    seed: Seed = 0,
) -> None:
    """Run an example through the service: a generated dental arch and its print, or your own two files.

    `cusp demo`

    `cusp demo --design design.stl --scan scan.ply --out result`
    """
    from service.demo.run import run_demo  # imports libraries that no other command needs

    raise typer.Exit(run_demo(server=server, data_dir=data_dir, out=out, design=design, scan=scan, seed=seed))


def _conclude(results: dict[str, Any], out: Path | None, as_json: bool) -> None:
    """Print the results; the exit code of a registration tells its verdict, then the decision on the part."""
    if as_json:
        typer.echo(json.dumps(results, indent=2))
    else:
        print_results(results, out, Console())
    if results["type"] == "registration":
        code = EXITS[results["verdict"]["status"]]
        inspection = results.get("inspection")  # a service of an earlier version has none
        if inspection is not None and inspection["decision"] == "fail":
            code = FAIL  # also where the alignment is uncertain because the part differs in a place
        raise typer.Exit(code)
