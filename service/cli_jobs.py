"""Commands on meshes: without a server, through one, and the demonstration."""

import json
from pathlib import Path
from typing import Annotated, Any, NoReturn, get_args

import typer
from rich.console import Console
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeElapsedColumn

from pipeline import MeshFile, PipelineError, Unit, find_segments
from pipeline import register as register_meshes
from service.client import Client, ServiceProblem, ServiceUnreachable
from service.errors import ServiceError
from service.options import parse_options, resolve_settings
from service.report import print_results, print_segments

EXIT_OTHER_VERDICT = 3
DEFAULT_SERVER = "http://127.0.0.1:8000"

MeshPath = Annotated[Path, typer.Argument(exists=True, dir_okay=False, readable=True)]
Server = Annotated[str, typer.Option(help="address of the service", envvar="CUSP_SERVER")]
Tolerance = Annotated[float | None, typer.Option(help="for the shares within, above and below")]
SettingsFile = Annotated[
    Path | None,
    typer.Option("--settings", exists=True, dir_okay=False, help="JSON with any part of the settings"),
]
UnitOption = Annotated[str, typer.Option(help="auto, mm, cm, m or inch")]
AsJson = Annotated[bool, typer.Option("--json", help="print results.json instead of the summary")]
Seed = Annotated[int, typer.Option(help="of every random draw")]
Preset = Annotated[str, typer.Option(help="default or paper")]


def register(
    design: MeshPath,
    scan: MeshPath,
    out: Annotated[Path, typer.Option(help="folder for results.json and the files")],
    preset: Preset = "default",
    tolerance_mm: Tolerance = None,
    unit_design: UnitOption = "auto",
    unit_scan: UnitOption = "auto",
    seed: Seed = 0,
    settings: SettingsFile = None,
    as_json: AsJson = False,
) -> None:
    """Register SCAN to DESIGN here, without a server. Exit code 0: verdict ok; 3: another verdict; 1: bad input."""
    given = _options(preset, tolerance_mm, unit_design, unit_scan, seed, settings)
    try:
        options = parse_options(given)
        with _bar() as bar:
            task = bar.add_task("starting", total=100.0)
            result = register_meshes(
                MeshFile(design, unit=options.units.design, filename=design.name),
                MeshFile(scan, unit=options.units.scan, filename=scan.name),
                settings=resolve_settings(options),
                tolerance_mm=options.tolerance_mm,
                seed=options.seed,
                out=out,
                on_progress=lambda step: bar.update(task, completed=step.percent, description=step.message),
            )
    except (PipelineError, ServiceError) as error:
        _refuse(error.detail)
    _conclude(json.loads(result.model_dump_json()), out, as_json)


def segment(
    mesh: MeshPath,
    method: Annotated[
        str | None, typer.Option(help="cfsfdp, kmeans, fuzzy_cmeans, kmedians, kcenters or gaussian_mixture")
    ] = None,
    n_centres: Annotated[int | None, typer.Option(help="number of segments; else what density peaks find")] = None,
    out: Annotated[Path, typer.Option(help="folder for results.json and the files")] = Path("cusp-segments"),
    preset: Preset = "default",
    unit: UnitOption = "auto",
    seed: Seed = 0,
    settings: SettingsFile = None,
    as_json: AsJson = False,
) -> None:
    """Cut MESH into segments here, without a server: coloured PLY, table, decision graph. Exit code 1: bad input."""
    chosen = {"method": method, "n_centres": n_centres}
    try:
        meant = next((each for each in get_args(Unit) if each == unit), None)
        if meant is None:
            _refuse(f"--unit {unit}: must be one of {', '.join(get_args(Unit))}")
        given = _options(preset, None, "auto", "auto", seed, settings)
        sections: dict[str, Any] = parse_options(given).settings
        over = {key: value for key, value in chosen.items() if value is not None}
        given["settings"] = sections | {"segmentation": sections.get("segmentation", {}) | over}
        options = parse_options(given)
        with _bar() as bar:
            task = bar.add_task("starting", total=100.0)
            result = find_segments(
                MeshFile(mesh, unit=meant, filename=mesh.name),
                settings=resolve_settings(options),
                seed=options.seed,
                out=out,
                on_progress=lambda step: bar.update(task, completed=step.percent, description=step.message),
            )
    except (PipelineError, ServiceError) as error:
        _refuse(error.detail)
    results = json.loads(result.model_dump_json())
    if as_json:
        typer.echo(json.dumps(results, indent=2))
    else:
        print_segments(results, out, Console())


def submit(
    design: MeshPath,
    scan: MeshPath,
    server: Server = DEFAULT_SERVER,
    wait: Annotated[bool, typer.Option("--wait", help="wait for the end, and print the results")] = False,
    out: Annotated[Path | None, typer.Option(help="download the files to this folder (waits)")] = None,
    preset: Preset = "default",
    tolerance_mm: Tolerance = None,
    unit_design: UnitOption = "auto",
    unit_scan: UnitOption = "auto",
    seed: Seed = 0,
    settings: SettingsFile = None,
    label: Annotated[str | None, typer.Option(help="yours, for finding the job again")] = None,
    as_json: AsJson = False,
) -> None:
    """Send DESIGN and SCAN to a service. Without --wait, prints the job's id."""
    given = _options(preset, tolerance_mm, unit_design, unit_scan, seed, settings)
    try:
        with Client(server) as client:
            job = client.submit(design, scan, given | ({"label": label} if label else {}))
            if not wait and out is None:
                typer.echo(job.id)
                return
            with _bar() as bar:
                task = bar.add_task("waiting", total=100.0)
                client.wait(
                    job.id,
                    lambda now: bar.update(task, completed=now.progress, description=now.message or now.status.value),
                )
            results = client.results(job.id)
            if out is not None:
                out.mkdir(parents=True, exist_ok=True)
                for file in client.files(job.id):
                    client.download(job.id, file.name, out / file.name)
    except ServiceProblem as error:
        _refuse(error.problem.detail)
    except ServiceUnreachable as error:
        _refuse(str(error))
    _conclude(results, out, as_json)


def demo(
    server: Server = DEFAULT_SERVER,
    data_dir: Annotated[Path, typer.Option(help="of the service that is started when none runs")] = Path("cusp-data"),
    out: Annotated[Path, typer.Option(help="folder for the meshes and the results")] = Path("cusp-demo"),
    design: Annotated[Path | None, typer.Option(exists=True, dir_okay=False, help="your design mesh")] = None,
    scan: Annotated[Path | None, typer.Option(exists=True, dir_okay=False, help="your scan mesh")] = None,
    seed: Seed = 0,
) -> None:
    """Show the service at work: a dental arch by formula and a print of it, or your own two files."""
    from service.demo import run_demo  # it draws on libraries that no other command needs

    raise typer.Exit(run_demo(server=server, data_dir=data_dir, out=out, design=design, scan=scan, seed=seed))


def _options(
    preset: str,
    tolerance_mm: float | None,
    unit_design: str,
    unit_scan: str,
    seed: int,
    settings: Path | None,
) -> dict[str, Any]:
    """The same `options` that a request has."""
    options: dict[str, Any] = {
        "preset": preset,
        "units": {"design": unit_design, "scan": unit_scan},
        "seed": seed,
        "tolerance_mm": tolerance_mm,
    }
    if settings is not None:
        try:
            options["settings"] = json.loads(settings.read_text())
        except ValueError as error:
            _refuse(f"{settings}: not JSON ({error})")
    return options


def _conclude(results: dict[str, Any], out: Path | None, as_json: bool) -> None:
    if as_json:
        typer.echo(json.dumps(results, indent=2))
    else:
        print_results(results, out, Console())
    if results["verdict"]["status"] != "ok":
        raise typer.Exit(EXIT_OTHER_VERDICT)


def _bar() -> Progress:
    """On standard error, so that `--json` can be piped."""
    return Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        TaskProgressColumn(),
        TimeElapsedColumn(),
        console=Console(stderr=True),
        transient=True,
    )


def _refuse(reason: str) -> NoReturn:
    typer.secho(f"cusp: {reason}", err=True, fg="red")
    raise typer.Exit(1)
