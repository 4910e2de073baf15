"""The command line: one module per command, each importing its job only when it is called."""

from __future__ import annotations

import sys

import typer

from flownav.cli import bench as bench
from flownav.cli import flow as flow
from flownav.cli import fly as fly
from flownav.cli import replay as replay
from flownav.cli import report as report
from flownav.cli import rig as rig
from flownav.cli import vehicle as vehicle
from flownav.errors import FlownavError, InputError

app = typer.Typer(
    name="flownav",
    help="GPS/INS + optical-flow navigation for precision VTOL take-off and landing.",
    no_args_is_help=True,
    add_completion=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)
app.command("fly")(fly.command)
app.command("replay")(replay.command)
app.command("rig")(rig.command)
app.command("flow")(flow.command)
app.command("vehicle")(vehicle.command)
app.command("report")(report.command)
app.command("bench")(bench.command)


def main() -> None:
    """Entry point: a mistake of the user's is one line on standard error and exit status 2, a bad verdict 1."""
    try:
        app()
    except FlownavError as error:
        print(f"flownav: {error}", file=sys.stderr)
        sys.exit(2 if isinstance(error, InputError) else 1)
