"""`cusp characteristics`: named regions, limits and the alignment that a service keeps with a design."""

import hashlib
import json
from pathlib import Path
from typing import Annotated

import typer

from service.cli.connection import connected
from service.cli.jobs import Server
from service.cli.options import refuse
from service.client.requests import DEFAULT_SERVER
from service.client.sync import Client

app = typer.Typer(
    help="Regions, limits and alignment that a service keeps with a design for its scans.",
    no_args_is_help=True,
)
Design = Annotated[str, typer.Argument(metavar="DESIGN", help="file of the design, or the id of its blob")]


@app.command()
def put(
    design: Design,
    document: Annotated[Path, typer.Argument(exists=True, dir_okay=False, help="JSON file")],
    server: Server = DEFAULT_SERVER,
    if_version: Annotated[
        str | None, typer.Option("--if-version", help="only if this version is kept now; see `version`")
    ] = None,
    only_new: Annotated[bool, typer.Option("--only-new", help="only if nothing is kept yet")] = False,
) -> None:
    """Keep the JSON of DOCUMENT with DESIGN, which is sent if it is a file. Prints the blob and the version.

    `cusp characteristics put design.step drawing.json`
    """
    if if_version is not None and only_new:
        refuse("--if-version and --only-new contradict each other; give one of them")
    try:
        content = json.loads(document.read_bytes())
    except ValueError as error:
        refuse(f"{document}: not JSON ({error})")
    if not isinstance(content, dict):
        refuse(f"{document}: must be a JSON object")
    with connected(server) as client:
        blob = _sent(client, design)
        version = client.put_characteristics(blob, content, if_match=if_version, only_new=only_new)
        typer.echo(f"{blob}  {version}")


@app.command()
def get(design: Design, server: Server = DEFAULT_SERVER) -> None:
    """Print what is kept with DESIGN as JSON.

    `cusp characteristics get design.step > drawing.json`
    """
    with connected(server) as client:
        typer.echo(json.dumps(client.characteristics(_id_of(design)), indent=1))


@app.command()
def version(design: Design, server: Server = DEFAULT_SERVER) -> None:
    """Print the version of what is kept with DESIGN (its ETag), for --if-version.

    `cusp characteristics version design.step`
    """
    with connected(server) as client:
        typer.echo(client.characteristics_version(_id_of(design)))


@app.command()
def delete(design: Design, server: Server = DEFAULT_SERVER) -> None:
    """Forget what is kept with DESIGN. Jobs that were sent before keep theirs.

    `cusp characteristics delete design.step`
    """
    with connected(server) as client:
        client.delete_characteristics(_id_of(design))


def _sent(client: Client, design: str) -> str:
    """Id of the blob of a design; a file is sent."""
    return client.put_blob(Path(design)).id if _is_file(design) else design


def _id_of(design: str) -> str:
    """The same without sending it."""
    if not _is_file(design):
        return design
    with Path(design).open("rb") as file:
        return f"sha256:{hashlib.file_digest(file, 'sha256').hexdigest()}"


def _is_file(design: str) -> bool:
    if Path(design).is_file():
        return True
    if not design.startswith("sha256:"):
        refuse(f"{design}: no such file, and no id of a blob (sha256:...)")
    return False
