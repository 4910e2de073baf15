"""`flownav identify`: rig and flight logs into a sensor file, with intervals and a verdict on what they show."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer


def command(
    logs: Annotated[
        list[Path], typer.Argument(help="Rig folders or CSV files, or one flight log (docs/identification.md).")
    ],
    order: Annotated[str, typer.Option(help="auto, delay (gain and latency), 1 to 6, or e.g. 2+delay.")] = "auto",
    heights: Annotated[
        str | None, typer.Option(metavar="H[,H..]", help="Sensor's height [m]: one for all logs, or one each.")
    ] = None,
    reference: Annotated[str, typer.Option(help="auto; rig: velocity or encoder; flight: truth or gps.")] = "auto",
    flow_instance: Annotated[
        int | None, typer.Option("--flow-instance", metavar="N", help="Which of a flight's several flow sensors.")
    ] = None,
    autopilot: Annotated[
        str | None, typer.Option("--for", help="Also write this autopilot's parameters: px4 or ardupilot.")
    ] = None,
    base: Annotated[
        Path | None, typer.Option(help="Sensor file for what no log tells (optics, limits); the paper's where unsaid.")
    ] = None,
    out: Annotated[
        Path | None, typer.Option("--out", help="The sensor file; out/NAME.toml where unsaid.", show_default=False)
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object and nothing else.")] = False,
) -> None:
    """Identify a flow sensor: gain, latency, dynamics, noise, each with its interval, as a sensor file."""
    from flownav.api.identifying import require_logs

    require_logs(logs)

    from flownav.api.identifying import identify_logs
    from flownav.cli.output import require_writable
    from flownav.identification.job import parse_heights

    path = _sensor_path(out, logs)
    parameter_path = _parameter_path(path, autopilot)
    for output in (path, parameter_path):
        if output is not None:
            require_writable(output, *logs, base)
    sensor = identify_logs(logs, order, parse_heights(heights), reference, flow_instance=flow_instance, base=base)
    facts = sensor.facts | {"sensor": str(sensor.save(path))}
    if parameter_path is not None and autopilot is not None:
        facts |= {"parameters": str(parameter_path), "autopilot": sensor.save_parameters(parameter_path, autopilot)}
    if as_json:
        typer.echo(json.dumps(facts))
    elif sensor.findings is not None:
        from flownav.cli.identify_table import show

        show(sensor.findings, facts)


def _sensor_path(out: Path | None, logs: list[Path]) -> Path:
    from flownav.errors import InputError
    from flownav.identification.job import name_of

    path = out or Path("out") / f"{name_of(logs)}.toml"
    if path.suffix != ".toml":
        raise InputError(f"--out {path}: a sensor file's name ends in .toml")
    return path


def _parameter_path(path: Path, autopilot: str | None) -> Path | None:
    from flownav.errors import InputError

    if autopilot is None:
        return None
    from flownav.identification.autopilot_parameters import AUTOPILOTS

    if autopilot not in AUTOPILOTS:
        raise InputError(f"--for {autopilot}: px4 or ardupilot are possible")
    return path.with_suffix(AUTOPILOTS[autopilot])
