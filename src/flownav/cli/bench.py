"""`flownav bench`: how fast this machine runs flownav, measured in one run; `flownav schema`: what commands print."""

import json
from typing import Annotated, Any

import typer

from flownav.cli import options
from flownav.cli.options import named, option
from flownav.cli.output import Column, answer, emit, require_between, say, stages, table_of

WIDE = 144  # columns of the table
COMPILED = "what is measured, once, about 2 minutes in all"
COLUMNS = (
    Column("figure", "name"),
    Column("measured", lambda row: f"{row['value']:.3g} {row['unit']}"),
    Column("asked", lambda row: "" if row["asked"] is None else _asked(row)),
    Column("verdict", lambda row: {True: "reached", False: "missed", None: ""}[row["reached"]]),
    Column("note", "note"),
)


def command(
    flights: Annotated[int, option("N", "Flights in the batch that is timed.")] = 1024,
    as_json: options.Json = False,
) -> None:
    """Measure flights on both filters, lanes, the filters' steps, replay, start-up, compile time and memory."""
    from flownav.core.compile import announce_compilation
    from flownav.studies.benchmark.measures import measurements

    require_between("--flights", flights, 16, 1_000_000)
    figures = []
    asked = measurements(flights)
    with announce_compilation("bench", COMPILED), stages("Measuring", len(asked)) as begin:
        for name, measured in asked:
            begin(name)
            figures += measured()
    rows = [{**figure.__dict__, "reached": figure.reached} for figure in figures]
    shown = table_of(COLUMNS, rows, title="flownav on this machine", title_justify="left")
    shown.columns[1].justify = shown.columns[2].justify = "right"
    answer({"figures": rows}, as_json, lambda: say(shown, wide=WIDE))


def _asked(row: dict[str, Any]) -> str:
    return f"{'>=' if row['more_is_better'] else '<='} {row['asked']:g} {row['unit']}"


def _complete(incomplete: str) -> list[str]:
    from flownav.cli.schemas import names

    return [name for name in names() if name.startswith(incomplete)]


def schema(
    name: Annotated[
        str | None,
        named(
            "NAME",
            "Which schema, such as fly or file-scenario.",
            show_default="a list of them",
            autocompletion=_complete,
        ),
    ] = None,
    as_json: options.Json = False,
) -> None:
    """Print the JSON schema of a command's --json object (by the command's name), or of a file; or list them."""
    from flownav.cli.schemas import id_of, names, schema_of, title_of

    if name is not None:
        typer.echo(json.dumps(schema_of(name), indent=1))
    elif as_json:
        emit({"schemas": [{"name": each, "id": id_of(each)} for each in names()]})
    else:
        for each in names():
            typer.echo(f"{each:<18} {title_of(each)}")
