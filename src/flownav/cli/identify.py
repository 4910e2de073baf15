"""`flownav identify`: rig and flight logs into a sensor file, with intervals and a verdict on what they show."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from flownav.cli.choices import AUTOPILOTS, ORDERS, REFERENCES, one_of, option
from flownav.cli.options import FlowInstanceOption, ForceOption, JsonOption, out_option
from flownav.cli.output import emit

LogsArgument = Annotated[
    list[Path],
    typer.Argument(metavar="LOG", help="Rig folders or their CSV files, or one flight's log.", show_default=False),
]
OrderOption = Annotated[
    str, typer.Option(help="The model's order; delay is gain and latency alone.", **one_of(*ORDERS))
]
HEIGHTS = "Sensor's height [m], one for all logs or one each; repeated or with commas."
ReferenceOption = Annotated[
    str, typer.Option(help="What it is held against: of a rig, of a flight.", **one_of(*REFERENCES))
]
ForOption = Annotated[
    str | None, typer.Option("--for", help="Also write this autopilot's parameters.", **one_of(*AUTOPILOTS))
]
BASE = "The sensor file for what no log shows (optics, limits)."


def command(
    logs: LogsArgument,
    order: OrderOption = "auto",
    heights: Annotated[list[str] | None, option("M", HEIGHTS, unset="as the log says")] = None,
    reference: ReferenceOption = "auto",
    flow_instance: FlowInstanceOption = None,
    autopilot: ForOption = None,
    base: Annotated[Path | None, option("FILE.toml", BASE, unset="the paper's sensor")] = None,
    out: Annotated[Path | None, out_option("The sensor file (TOML)", "out/LOG.toml")] = None,
    force: ForceOption = False,
    as_json: JsonOption = False,
) -> None:
    """Identify a flow sensor: gain, latency, dynamics, noise, each with its interval, as a sensor file."""
    from flownav.api.identifying import require_logs

    require_logs(logs)

    from flownav.api.identifying import identify_logs
    from flownav.cli.lists import numbers
    from flownav.cli.output import place
    from flownav.lab.identification.autopilot_parameters import AUTOPILOTS as SUFFIXES

    suffix = None if autopilot is None else SUFFIXES[autopilot]
    path = place(_sensor_path(out, logs), *logs, base, force=force, beside=(suffix,) if suffix else ())
    parameter_path = path.with_suffix(suffix) if suffix else None
    heights_m = numbers("--heights", heights, 0.001, 1000.0) if heights else []
    sensor = identify_logs(logs, order, heights_m, reference, flow_instance=flow_instance, base=base)
    facts = sensor.facts | {"sensor": str(sensor.save(path))}
    if parameter_path is not None and autopilot is not None:
        facts |= {"parameters": str(parameter_path), "autopilot": sensor.save_parameters(parameter_path, autopilot)}
    if as_json:
        emit(facts)
    elif sensor.findings is not None:
        from flownav.cli.identify_table import show

        show(sensor.findings, facts)


def _sensor_path(out: Path | None, logs: list[Path]) -> Path:
    from flownav.core.errors import InputError
    from flownav.lab.identification.job import name_of

    path = out or Path("out") / f"{name_of(logs)}.toml"
    if path.suffix != ".toml":
        raise InputError(f"--out {path}: a sensor file's name ends in .toml")
    return path
