"""The command line: one module per command, each importing its job only when it is called."""

from __future__ import annotations

from typing import Annotated

import typer

from flownav.cli import accuracy as accuracy
from flownav.cli import bench as bench
from flownav.cli import campaign as campaign
from flownav.cli import certify as certify
from flownav.cli import compare as compare
from flownav.cli import envelope as envelope
from flownav.cli import export as export
from flownav.cli import faults as faults
from flownav.cli import flow as flow
from flownav.cli import fly as fly
from flownav.cli import identify as identify
from flownav.cli import info as info
from flownav.cli import live as live
from flownav.cli import pad as pad
from flownav.cli import paper as paper
from flownav.cli import recover as recover
from flownav.cli import replay as replay
from flownav.cli import report as report
from flownav.cli import rig as rig
from flownav.cli import sample as sample
from flownav.cli import schema as schema
from flownav.cli import tune as tune
from flownav.cli import validate as validate
from flownav.cli import vehicle as vehicle
from flownav.cli import view as view
from flownav.cli.running import run, say_version

app = typer.Typer(
    name="flownav",
    help="GPS/INS + optical-flow navigation for precision VTOL take-off and landing.",
    no_args_is_help=True,
    add_completion=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)
for name, command, what in (
    ("fly", fly.command, "Fly a take-off or landing in closed loop, scored beside the paper."),
    ("replay", replay.command, "Fuse a recorded flight; measure the drift without GPS."),
    ("compare", compare.command, "Many logs, many settings, beside dead reckoning and the autopilot."),
    ("tune", tune.command, "Propose settings from logs, judged on windows held out from the fit."),
    ("live", live.command, "Navigate a MAVLink vehicle in real time; send it the estimate."),
    ("sample", sample.command, "Write small simulated logs, to try the other commands on."),
    ("recover", recover.command, "Make the record of a live session that was killed."),
    ("info", info.command, "What a log holds: sensors, rates, gaps, signs, what it lacks."),
    ("identify", identify.command, "Identify a flow sensor from rig or flight logs; write its file."),
    ("rig", rig.command, "Swing a flow sensor over a pad beside an encoder, from pixels."),
    ("flow", flow.command, "Optical flow of your own frames, as the PX4FLOW computes it."),
    ("pad", pad.command, "Find the landing pad in a frame; measure how well, by height."),
    ("paper", paper.command, "Every table of the paper, published and reproduced side by side."),
    ("campaign", campaign.command, "Fly a scenario many times: accuracy with intervals, rare events."),
    ("certify", certify.command, "Pass, fail or not shown: a requirement flown, as a page to be signed."),
    ("accuracy", accuracy.command, "The landing filter against its targets, and what its pieces are worth."),
    ("envelope", envelope.command, "How surely a scenario lands, by the wind's speed and direction."),
    ("faults", faults.command, "Let sensors fail on a landing: when it is noticed, what it costs."),
    ("validate", validate.command, "Hold the simulator against recorded flights, figure beside figure."),
    ("vehicle", vehicle.command, "Trim, power, linear models and ground effect of a helicopter."),
    ("report", report.command, "Write a record's report as one HTML page."),
    ("view", view.command, "Show a record in space and time with Rerun, or write its .rrd."),
    ("export", export.command, "Write a record as MCAP, TUM, EuRoC, Parquet, CSV, ULog, KML or GPX."),
    ("schema", schema.command, "Print the JSON schema of a command's output or of a file."),
    ("bench", bench.command, "Measure how fast all of this is on your machine."),
):
    app.command(name, short_help=what)(command)


@app.callback()
def about(
    version: Annotated[
        bool, typer.Option("--version", help="Print the version and nothing else.", is_eager=True, callback=say_version)
    ] = False,
) -> None:
    """GPS/INS + optical-flow navigation for precision VTOL take-off and landing."""


def main() -> None:
    """Entry point: exit status 0 done, 1 a bad verdict, 2 a mistake of the user's (one line), 130 broken off."""
    run(app)
