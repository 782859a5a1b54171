"""The `cusp` command: the service, its client, and the method without a server."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, NoReturn

import typer
from pydantic import ValidationError

from service.cli import batches as cli_batches
from service.cli import characteristics as cli_characteristics
from service.cli import config as cli_config
from service.cli import jobs as cli_jobs
from service.cli import keys as cli_keys
from service.cli import meshes as cli_meshes
from service.cli import webhooks as cli_webhooks
from service.cli.part import become
from service.contract.invalid_values import reason
from service.settings import ServiceSettings

app = typer.Typer(
    name="cusp",
    help="Register the scan of a 3D-printed part to its design.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
)
app.command("register")(cli_jobs.register)
app.command("segment")(cli_meshes.segment)
app.command("landmarks")(cli_meshes.landmarks)
app.command("study")(cli_meshes.study)
app.command("submit")(cli_jobs.submit)
app.command("demo")(cli_jobs.demo)
app.add_typer(cli_batches.app, name="batch")
app.add_typer(cli_characteristics.app, name="characteristics")
app.add_typer(cli_keys.app, name="keys")
app.add_typer(cli_config.app, name="config")
app.add_typer(cli_webhooks.app, name="webhooks")


@app.command()
def up(
    host: Annotated[str | None, typer.Option(help="address to listen on [127.0.0.1]")] = None,
    port: Annotated[int | None, typer.Option(help="port to listen on [8000]")] = None,
    data_dir: Annotated[Path | None, typer.Option(help="databases, uploads and results [cusp-data]")] = None,
    jobs: Annotated[int | None, typer.Option(help="jobs run at the same time [half the processors]")] = None,
    allow_open: Annotated[
        bool, typer.Option("--allow-open", help="listen beyond loopback although there are no API keys")
    ] = False,
) -> None:
    """Run the service: the API and a worker. Options override CUSP_* variables.

    `cusp up --port 8000 --data-dir /var/lib/cusp --jobs 2`
    """
    from service.execution.supervisor import run_up
    from service.logs import set_up_logs

    overrides = {
        "host": host,
        "port": port,
        "data_dir": data_dir,
        "jobs": jobs,
        "allow_open": allow_open or None,
    }
    settings = _settings(**overrides)
    set_up_logs(settings, "parent")
    with _refusing():
        raise typer.Exit(run_up(settings))


@app.command()
def api() -> None:
    """Run one API process. All parts share CUSP_DATABASE_URL and CUSP_BLOB_URL.

    `CUSP_DATABASE_URL=postgresql://cusp:...@db/cusp CUSP_BLOB_URL=s3://cusp CUSP_HOST=0.0.0.0 cusp api`
    """
    become("api")


@app.command()
def worker() -> None:
    """Run one worker process. Each needs its own CUSP_WORKER_ID.

    `CUSP_DATABASE_URL=postgresql://... CUSP_BLOB_URL=s3://cusp CUSP_WORKER_ID=worker-7 cusp worker`
    """
    become("worker")


@app.command()
def openapi(out: Annotated[Path, typer.Option(help="folder to write to")] = Path("openapi")) -> None:
    """Write the OpenAPI document and the examples.

    `cusp openapi --out openapi`
    """
    from service.api.openapi_files import write

    write(out)
    typer.echo(f"wrote {out}/openapi.json and {out}/examples")


def main() -> None:
    """Entry of the console script."""
    app()


@contextmanager
def _refusing() -> Iterator[None]:
    """Print in one line why the service cannot start."""
    from service.auth.keys import Exposed
    from service.execution.supervisor import AlreadyRunning, NotApart
    from service.storage.database import NoDatabase

    try:
        yield
    except (AlreadyRunning, Exposed, NotApart, NoDatabase) as error:
        _refuse(str(error))


def _settings(**overrides: object) -> ServiceSettings:
    try:
        return ServiceSettings.model_validate(
            {
                **ServiceSettings().model_dump(),
                **{key: value for key, value in overrides.items() if value is not None},
            }
        )
    except ValidationError as error:
        reasons = "; ".join(": ".join([*map(str, each["loc"]), reason(each)]) for each in error.errors())
        _refuse(reasons)


def _refuse(reason: str) -> NoReturn:
    typer.secho(f"cusp: {reason}", err=True, fg="red")
    raise typer.Exit(1)


if __name__ == "__main__":
    main()
