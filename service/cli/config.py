"""`cusp config show`: the present settings, and the source of each."""

import json
import os
from typing import Annotated, Any

import typer
from pydantic import SecretStr, ValidationError
from rich.console import Console
from rich.table import Table
from sqlalchemy import make_url

from service.cli.options import refuse
from service.contract.invalid_values import reason
from service.settings import ServiceSettings

app = typer.Typer(help="The settings of the service.", no_args_is_help=True)


@app.command()
def show(as_json: Annotated[bool, typer.Option("--json", help="print JSON")] = False) -> None:
    """Print every setting, its value and whether the environment set it. Passwords are not shown.

    `CUSP_JOBS=4 cusp config show`
    """
    try:
        settings = ServiceSettings()
    except ValidationError as error:
        reasons = [
            f"CUSP_{'.'.join(map(str, each['loc'])).upper()}: {reason(each)}" for each in error.errors()
        ]
        refuse("; ".join(reasons))
    rows = []
    for name, field in ServiceSettings.model_fields.items():
        variable = f"CUSP_{name.upper()}"
        rows.append(
            {
                "variable": variable,
                "value": _shown(getattr(settings, name)),
                "from": "environment" if variable in os.environ else "default",
                "meaning": field.description,
            }
        )
    if as_json:
        typer.echo(json.dumps(rows, indent=1))
        return
    table = Table("variable", "value", "from", "meaning")
    for row in rows:
        table.add_row(*(str(value) for value in row.values()))
    Console().print(table)


def _shown(value: Any) -> Any:
    if isinstance(value, SecretStr):
        url = value.get_secret_value()
        return make_url(url).render_as_string(hide_password=True) if url else ""
    return value if isinstance(value, bool | int | float | str) else str(value)
