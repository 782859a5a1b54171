"""Commands for webhooks: show or rotate the secret of a tenant."""

from pathlib import Path
from typing import Annotated

import typer

from service.cli.options import opened_database
from service.webhooks.outbox import Deliveries

app = typer.Typer(help="Webhooks: the secret that messages are signed with.", no_args_is_help=True)


@app.command()
def secret(
    tenant: Annotated[str, typer.Option(help="whose messages")] = "default",
    rotate: Annotated[bool, typer.Option("--rotate", help="make a new one; for a day both are used")] = False,
    data_dir: Annotated[
        Path | None, typer.Option(help="data folder of the service [CUSP_DATA_DIR or cusp-data]")
    ] = None,
) -> None:
    """Print the secret (`whsec_...`), for the receiver to check `webhook-signature` with.

    `cusp webhooks secret --tenant acme --rotate`
    """
    with opened_database(data_dir) as engine:
        deliveries = Deliveries(engine)
        typer.echo(deliveries.rotate(tenant) if rotate else deliveries.secrets(tenant)[0])
