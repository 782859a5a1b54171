"""Commands for API keys: create, list, revoke. They use the database; the service may run or not."""

import json
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.table import Table

from service.auth.keys import BadTenant, KeyRow, KeyStore, Scope
from service.cli.options import opened_database, refuse

app = typer.Typer(help="API keys: from the first one on, every request needs one.", no_args_is_help=True)
DataDir = Annotated[Path | None, typer.Option(help="data folder of the service [CUSP_DATA_DIR or cusp-data]")]


@app.command()
def create(
    tenant: Annotated[str, typer.Option(help="whose jobs and meshes the key sees")] = "default",
    scope: Annotated[list[Scope] | None, typer.Option(help="repeat for more [jobs:write jobs:read]")] = None,
    name: Annotated[str, typer.Option(help="free text, to find it in the list")] = "",
    data_dir: DataDir = None,
) -> None:
    """Make a key and print it. It is shown once; only a hash of it is stored.

    `cusp keys create --tenant acme --name "MES of line 2"`
    """
    with _keys(data_dir) as keys:
        try:
            _, text = keys.create(tenant, scope or [Scope.WRITE, Scope.READ], name)
        except BadTenant as error:
            refuse(str(error))
    typer.echo(text)


@app.command("list")
def list_keys(
    data_dir: DataDir = None, as_json: Annotated[bool, typer.Option("--json", help="print JSON")] = False
) -> None:
    """List the keys, without their secrets.

    `cusp keys list`
    """
    with _keys(data_dir) as keys:
        rows = keys.all()
    if as_json:
        typer.echo(json.dumps([_as_dict(row) for row in rows], indent=1))
        return
    table = Table("id", "tenant", "scopes", "name", "created", "revoked")
    for row in rows:
        shown = _as_dict(row)
        table.add_row(
            *(str(shown[key] or "") for key in ("id", "tenant", "scopes", "name", "created", "revoked"))
        )
    Console().print(table)


@app.command()
def revoke(
    key_id: Annotated[str, typer.Argument(help="of `cusp keys list`")], data_dir: DataDir = None
) -> None:
    """Revoke a key. The jobs of its tenant remain.

    `cusp keys revoke 1f0c9a77b2e4`
    """
    with _keys(data_dir) as keys:
        if not keys.revoke(key_id):
            refuse(f"no key {key_id!r} is in use; see `cusp keys list`")
    typer.echo(f"{key_id} is revoked")


@contextmanager
def _keys(data_dir: Path | None) -> Iterator[KeyStore]:
    with opened_database(data_dir) as engine:
        yield KeyStore(engine)


def _as_dict(row: KeyRow) -> dict[str, str | None]:
    return {
        "id": row.id,
        "tenant": row.tenant,
        "scopes": " ".join(row.scopes),
        "name": row.name,
        "created": _time(row.created_ms),
        "revoked": None if row.revoked_ms is None else _time(row.revoked_ms),
    }


def _time(ms: int) -> str:
    return datetime.fromtimestamp(ms / 1000, UTC).strftime("%Y-%m-%dT%H:%M:%SZ")
