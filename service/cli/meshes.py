"""Commands on one mesh, here, without a server: segment, landmarks, study. Exit code 1: bad input."""

import json
from pathlib import Path
from typing import Annotated, Any, Protocol

import typer
from pydantic import BaseModel
from rich.console import Console

import pipeline
from pipeline import MeshFile, OnProgress, PipelineError, Settings
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
from service.client.results_table import print_results
from service.contract.errors import ServiceError
from service.contract.options import parse_options, resolve_settings

DETECTORS = "t2, gaussian_curvature, agd, hks, iss, gp, farthest or random"


class Verb(Protocol):
    """A function of the public API on one mesh."""

    def __call__(
        self, mesh: MeshFile, *, settings: Settings, out: Path, seed: int, on_progress: OnProgress
    ) -> BaseModel: ...


def segment(
    mesh: MeshPath,
    method: Annotated[
        str | None, typer.Option(help="cfsfdp, kmeans, fuzzy_cmeans, kmedians, kcenters or gaussian_mixture")
    ] = None,
    n_centres: Annotated[
        int | None, typer.Option(help="number of segments; by default found by density peaks")
    ] = None,
    out: Out = Path("cusp-segments"),
    preset: Preset = "default",
    unit: UnitOption = "auto",
    seed: Seed = 0,
    settings: SettingsFile = None,
    as_json: AsJson = False,
) -> None:
    """Segment MESH: coloured PLY, table, decision graph.

    `cusp segment part.stl --method kmeans --n-centres 14 --out segments`
    """
    options_document = options_of(preset=preset, units={"mesh": unit}, seed=seed, settings=settings)
    chosen = {"segmentation": {"method": method, "n_centres": n_centres}}
    _run(pipeline.find_segments, mesh, options_document, chosen, out, as_json)


def landmarks(
    mesh: MeshPath,
    detector: Annotated[str | None, typer.Option(help=DETECTORS)] = None,
    count: Annotated[int | None, typer.Option(help="maximum number, the strongest first")] = None,
    out: Out = Path("cusp-landmarks"),
    preset: Preset = "default",
    unit: UnitOption = "auto",
    seed: Seed = 0,
    settings: SettingsFile = None,
    as_json: AsJson = False,
) -> None:
    """Find the segments and the landmarks of MESH: table, coloured PLY, decision graph.

    `cusp landmarks part.stl --count 20 --out landmarks`
    """
    options_document = options_of(preset=preset, units={"mesh": unit}, seed=seed, settings=settings)
    chosen = {"landmarks": {"detector": detector, "count": count}}
    _run(pipeline.find_landmarks, mesh, options_document, chosen, out, as_json)


def study(
    mesh: MeshPath,
    kind: Annotated[
        str | None, typer.Option(help="informativeness (the paper's protocol) or repeatability")
    ] = None,
    trials: Annotated[
        int | None, typer.Option(help="number of trials: 10,000, or 5 per condition for repeatability")
    ] = None,
    detectors: Annotated[
        list[str] | None, typer.Option(help=f"to compare, with commas or repeated: {DETECTORS}")
    ] = None,
    noise_mm: Annotated[
        float | None, typer.Option(help="displacement of the copy; noise for repeatability")
    ] = None,
    eps: Annotated[
        float | None, typer.Option(help="repeatability: distance of a match, as a share of the diagonal")
    ] = None,
    rotation_deg: Annotated[
        float | None, typer.Option(help="informativeness: maximum rotation of the copy")
    ] = None,
    count: Annotated[int | None, typer.Option(help="points per detector")] = None,
    out: Out = Path("cusp-study"),
    preset: Preset = "default",
    unit: UnitOption = "auto",
    seed: Seed = 0,
    settings: SettingsFile = None,
    as_json: AsJson = False,
) -> None:
    """Compare the landmarks of MESH with other detectors: table, all trials, plot.

    `cusp study part.stl --trials 1000 --detectors t2,iss,random`

    `cusp study part.stl --kind repeatability --eps 0.01`
    """
    options_document = options_of(preset=preset, units={"mesh": unit}, seed=seed, settings=settings)
    names = [name.strip() for each in detectors or [] for name in each.split(",")]
    chosen = {"kind": kind, "trials": trials, "noise_mm": noise_mm, "eps": eps, "rotation_deg": rotation_deg}
    _run(
        pipeline.study,
        mesh,
        options_document,
        {"study": {**chosen, "count": count, "detectors": names or None}},
        out,
        as_json,
    )


def _run(
    verb: Verb,
    mesh: Path,
    options_document: dict[str, Any],
    chosen: dict[str, dict[str, Any]],
    out: Path,
    as_json: bool,
) -> None:
    """Run `verb` and print its results. chosen : section -> key -> value that replaces a setting, None
    ignored
    """
    try:
        options_document["settings"] = _over(parse_options(options_document).settings, chosen)
        options = parse_options(options_document)
        with progress_bar() as bar:
            task = bar.add_task("starting", total=100.0)
            result = verb(
                MeshFile(mesh, unit=options.units.mesh, filename=mesh.name),
                settings=resolve_settings(options),
                seed=options.seed,
                out=out,
                on_progress=lambda step: bar.update(task, completed=step.percent, description=step.message),
            )
    except (PipelineError, ServiceError) as error:
        refuse(error.detail)
    results = json.loads(result.model_dump_json())
    if as_json:
        typer.echo(json.dumps(results, indent=2))
    else:
        print_results(results, out, Console())


def _over(settings: dict[str, Any], chosen: dict[str, dict[str, Any]]) -> dict[str, Any]:
    sections = {
        name: settings.get(name, {}) | {key: value for key, value in section.items() if value is not None}
        for name, section in chosen.items()
    }
    return settings | sections
