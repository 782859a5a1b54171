"""What the commands on meshes share: their options, the bar while they compute, and how they refuse."""

import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any, NoReturn

import typer
from rich.console import Console
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeElapsedColumn
from sqlalchemy import Engine

from pipeline import Reference
from service.settings import ServiceSettings
from service.storage.database import NoDatabase, migrate, migrating, open_database

MeshPath = Annotated[Path, typer.Argument(exists=True, dir_okay=False, readable=True)]
Out = Annotated[Path, typer.Option(help="folder for results.json and the files")]
SettingsFile = Annotated[
    Path | None,
    typer.Option("--settings", exists=True, dir_okay=False, help="JSON with any part of the settings"),
]
UnitOption = Annotated[str, typer.Option(help="auto, mm, cm, m or inch")]
AsJson = Annotated[bool, typer.Option("--json", help="print results.json instead of the summary")]
Seed = Annotated[int, typer.Option(help="seed of every random draw")]
Preset = Annotated[str, typer.Option(help="default or paper")]


def options_of(
    *,
    preset: str,
    units: dict[str, str],
    seed: int,
    settings: Path | None,
    tolerance_mm: float | None = None,
    acceptance: Path | None = None,
    alignment: Path | None = None,
    reference: list[str] | None = None,
    **others: float | str | None,
) -> dict[str, Any]:
    """The same `options` that a request has. others : options by name, None where the user states none"""
    options: dict[str, Any] = {"preset": preset, "units": units, "seed": seed, "tolerance_mm": tolerance_mm}
    # a service of an earlier version refuses keys that it does not know
    options |= {name: value for name, value in others.items() if value is not None}
    if settings is not None:
        options["settings"] = _json(settings)
    if acceptance is not None:
        options["acceptance"] = _json(acceptance)
    if alignment is not None:
        options["alignment"] = _json(alignment)
    if reference:
        options["reference"] = _reference(reference)
    return options


def _json(path: Path) -> Any:
    try:
        return json.loads(path.read_text())
    except ValueError as error:
        refuse(f"{path}: not JSON ({error})")


def _reference(pairs: list[str]) -> dict[str, Any]:
    """`serial=A-17` for the keys that the service knows, and `more` for the client's own."""
    reference: dict[str, Any] = {}
    for pair in pairs:
        key, equals, value = pair.partition("=")
        if not equals:
            refuse(f"--reference {pair}: must be KEY=VALUE, for example serial=A-17")
        if key in Reference.model_fields and key != "more":
            reference[key] = value
        else:
            reference.setdefault("more", {})[key] = value
    return reference


def progress_bar() -> Progress:
    """On standard error, so that `--json` can be piped."""
    return Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        TaskProgressColumn(),
        TimeElapsedColumn(),
        console=Console(stderr=True),
        transient=True,
    )


def refuse(reason: str) -> NoReturn:
    """End with one sentence and exit code 1."""
    typer.secho(f"cusp: {reason}", err=True, fg="red")
    raise typer.Exit(1)


@contextmanager
def opened_database(data_dir: Path | None) -> Iterator[Engine]:
    """The service's tables, made when they are not there yet; while the service runs or not."""
    settings = ServiceSettings() if data_dir is None else ServiceSettings(data_dir=data_dir)
    settings.make_folders()
    try:
        with migrating(settings.database):
            migrate(settings.database)
    except NoDatabase as error:
        refuse(str(error))
    engine = open_database(settings.database)
    try:
        yield engine
    finally:
        engine.dispose()
