"""The command line: one module per command, each importing its job only when it is called; how it runs and ends."""

import io
import os
import re
import sys
from collections.abc import Iterable
from importlib import import_module
from typing import TYPE_CHECKING, Annotated, Any

import typer

from flownav.core.compiling.progress import announce_compilation
from flownav.core.errors import FlownavError, InputError
from flownav.core.guard import a_run
from flownav.core.text import harmless
from flownav.core.version import __version__

DONE, BAD_VERDICT, BAD_INPUT, BROKEN_OFF = 0, 1, 2, 130  # the last of Ctrl-C, as shells have it
# commands that share a module, and the function that each is there; any other is `command` of a module of its name
ELSEWHERE = {
    "app": ("page", "command"), "report": ("records", "report"), "view": ("records", "view"),
    "export": ("records", "export_to"), "recover": ("records", "recover"), "schema": ("bench", "schema"),
    "tune": ("compare", "tune_settings"), "sample": ("rig", "sample"), "info": ("replay", "info"),
    "flow": ("identify", "flow"),
    "validate": ("paper", "validate"), "envelope": ("campaign", "envelope"), "verify": ("build", "verify"),
}  # fmt: skip
# options that are not called as the argument in Python is, without its unit
OPTIONS = {
    "autopilot": "--for", "factor": "--bin", "gps_outages": "--gps-outage", "original": "--merge", "topics": "--topic",
    "url": "--mavlink",
}  # fmt: skip
if TYPE_CHECKING:
    app: typer.Typer
COMMANDS = {  # by name, as the help lists them
    "fly": "Fly a mission, a take-off or a landing in simulation; table, record, report.",
    "replay": "Fuse a recorded flight; measure the drift without GPS.",
    "compare": "Many logs, many settings, beside dead reckoning and the autopilot.",
    "tune": "Propose settings from logs, judged on windows held out from the fit.",
    "live": "Navigate a MAVLink vehicle in real time; send it the estimate.",
    "sitl": "Fly a real autopilot's simulator on flownav; faults; scored.",
    "sample": "Write small simulated logs, to try the other commands on.",
    "recover": "Make the record of a live session that was killed.",
    "info": "Content of a log: sensors, rates, gaps, signs, missing sensors.",
    "explain": "Why a log drifted: the first cause, its evidence, what cures it.",
    "identify": "Identify a flow sensor from rig or flight logs; write its file.",
    "rig": "Swing a flow sensor over a pad beside an encoder, from pixels.",
    "flow": "Optical flow of your own frames, as the PX4FLOW computes it.",
    "pad": "Find the landing pad in a frame; measure how well, by height.",
    "paper": "Every table of the paper, published and reproduced side by side.",
    "campaign": "Fly a scenario many times: accuracy with intervals, rare events.",
    "certify": "Pass, fail or not shown: a requirement flown, as a page to be signed.",
    "accuracy": "The landing filter against its targets, and what its pieces are worth.",
    "envelope": "How surely a scenario lands, by the wind's speed and direction.",
    "faults": "Let sensors fail on a landing: when it is noticed, what it costs.",
    "validate": "Hold the simulator against recorded flights, figure beside figure.",
    "vehicle": "Trim, power, linear models and ground effect of a helicopter.",
    "app": "A page for who does not type: logs, GPS cuts, flights, certificates.",
    "report": "Write a record's report as one HTML page.",
    "view": "Show a record in space and time with Rerun, or write its .rrd.",
    "export": "Write a record as MCAP, TUM, EuRoC, Parquet, CSV, ULog, KML or GPX.",
    "build": "The navigator as a library: flight controller, companion, browser.",
    "verify": "Compare what a board or a browser says with replay, bit for bit.",
    "schema": "Print the JSON schema of a command's output or of a file.",
    "bench": "Measure how fast all of this is on your machine.",
}


def say_version(asked: bool) -> None:
    """The version, and nothing else is done."""
    if asked:
        typer.echo(f"flownav {__version__}")
        raise typer.Exit


def about(
    version: Annotated[
        bool, typer.Option("--version", help="Print the version and nothing else.", is_eager=True, callback=say_version)
    ] = False,
) -> None:
    """GPS/INS + optical-flow navigation for precision VTOL take-off and landing."""


def made(names: Iterable[str]) -> typer.Typer:
    """The command line with these commands."""
    app = typer.Typer(
        name="flownav",
        help="GPS/INS + optical-flow navigation for precision VTOL take-off and landing.",
        no_args_is_help=True,
        add_completion=True,
        pretty_exceptions_enable=False,
        rich_markup_mode=None,
    )
    app.callback()(about)
    for name in names:
        module, function = ELSEWHERE.get(name, (name, "command"))
        found = import_module(f"flownav.cli.{module}")
        app.command(name, cls=getattr(found, "SHOWN", None), short_help=COMMANDS[name])(getattr(found, function))
    return app


def __getattr__(name: str) -> Any:
    """`app`, the command line with every command, made when it is first asked for."""
    if name != "app":
        raise AttributeError(f"module 'flownav.cli' has no attribute {name!r}")
    globals()["app"] = whole = made(COMMANDS)
    return whole


def asked() -> typer.Typer:
    """The command line with the command that is named alone, or all: making all takes as long as a short one runs."""
    return made(sys.argv[1:2] if COMMANDS.keys() & set(sys.argv[1:2]) else COMMANDS)


def main() -> None:
    """Run what is asked: exit status 0 done, 1 a bad verdict, 2 a mistake of the user's (one line), 130 broken off."""
    run(asked())


def run(app: typer.Typer) -> None:
    """Run a command and leave with its exit status."""
    for stream in (sys.stdout, sys.stderr):  # names of files are bytes, and need not be text
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")
    try:
        with a_run(), announce_compilation("flownav", throughout=True):
            status = app(prog_name="flownav", standalone_mode=False)
    except FlownavError as error:
        _leave(error.naming(option_of), BAD_INPUT if isinstance(error, InputError) else BAD_VERDICT)
    except typer.TyperException as error:
        if not hasattr(error, "format_message"):
            raise
        _leave_usage(error)
    except typer.Abort:
        _leave("broken off", BAD_VERDICT)
    except KeyboardInterrupt:  # before or behind the command
        sys.exit(BROKEN_OFF)
    except MemoryError:
        _leave("there is not enough memory for this; give less at once", BAD_INPUT)
    except OSError as error:  # a disk that is full, a file that went away
        _leave(f"{error.filename or _unwritten()}: {error.strerror or error}", BAD_INPUT)
    sys.exit(status if isinstance(status, int) else DONE)


def _unwritten() -> str:
    """The name for an error of writing that names no file: "the output" where the rest of it is refused again, or where
    the file that it goes to has no room.
    """
    try:
        sys.stdout.flush()
        room = os.fstatvfs(sys.stdout.fileno())
    except OSError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # or Python tries, and complains, once more
        return "the output"
    return "a file" if room.f_bavail or not room.f_blocks else "the output"


def option_of(argument: str) -> str:
    """The option that gives what Python gives as this argument: --gps-delay of gps_delay_s."""
    return OPTIONS.get(argument) or f"--{re.sub('_(s|m)$', '', argument).replace('_', '-')}"


def _leave_usage(error: typer.TyperException) -> None:
    """Leave with one line on a usage error, and the command that shows the usage."""
    context = getattr(error, "ctx", None)
    command = context.command_path if context is not None else "flownav"
    message = error.format_message().replace("\n", " ").strip()
    if not message or type(error).__name__ == "NoArgsIsHelpError":
        typer.echo(context.get_help() if context is not None else "", err=True)
        sys.exit(BAD_INPUT)
    _leave(f"{message.rstrip('.')}; `{command} --help` lists what can be given", BAD_INPUT)


def _leave(message: str, status: int) -> None:
    print(f"flownav: {harmless(message)}", file=sys.stderr)
    sys.exit(status)
