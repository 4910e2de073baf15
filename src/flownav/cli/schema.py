"""`flownav schema`: the schemas of what commands print and of the files that they read."""

from __future__ import annotations

import json
from typing import Annotated

import typer

from flownav.cli import options


def _complete(incomplete: str) -> list[str]:
    from flownav.core.schemas import names

    return [name for name in names() if name.startswith(incomplete)]


def command(
    name: Annotated[
        str | None,
        typer.Argument(
            metavar="NAME",
            help="Which schema, such as fly or file-scenario.",
            show_default="a list of them",
            autocompletion=_complete,
        ),
    ] = None,
    as_json: options.Json = False,
) -> None:
    """Print the JSON schema of a command's --json object (by the command's name), or of a file; or list them."""
    from flownav.cli.output import emit
    from flownav.core.schemas import names, schema_of

    if name is not None:
        typer.echo(json.dumps(schema_of(name), indent=1))
    elif as_json:
        emit({"schemas": [{"name": each, "id": schema_of(each)["$id"]} for each in names()]})
    else:
        for each in names():
            typer.echo(f"{each:<18} {schema_of(each).get('title', '')}")
