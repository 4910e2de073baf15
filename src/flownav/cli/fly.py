"""`flownav fly`: a scenario flown in closed loop, scored beside the paper's tables."""

from __future__ import annotations

import json
from contextlib import nullcontext
from pathlib import Path
from typing import Annotated

import typer

from flownav.cli.output import VehicleOption
from flownav.errors import InputError, VerdictError

CRASHES_ALLOWED = 0.05  # of the flights, before the exit status says that the verdict is bad


def command(
    scenario: Annotated[
        str, typer.Argument(help="takeoff, landing, gusty, pad_return, approach, or a scenario file (TOML).")
    ],
    flights: Annotated[int, typer.Option(help="How many flights; more than one gives medians and 5-95 %.")] = 1,
    flight: Annotated[int | None, typer.Option(help="Fly this one flight of the seed again, counted from 0.")] = None,
    seed: Annotated[int, typer.Option(help="The campaign's noise; flight k of a seed is always the same flight.")] = 1,
    gps: Annotated[str | None, typer.Option(help="GPS error model: white or midg.")] = None,
    filter_name: Annotated[
        str | None, typer.Option("--filter", help="landing, paper, an installed filter's name, or file.py:Class.")
    ] = None,
    feedback: Annotated[str | None, typer.Option(help="What the autopilot flies on: estimate or truth.")] = None,
    truth: Annotated[str | None, typer.Option(help="The plant: nonlinear, or the paper's linear model.")] = None,
    optics: Annotated[
        str | None, typer.Option(help="The pad camera: model, or pixels (its frames are rendered; minutes a flight).")
    ] = None,
    sensor: Annotated[str | None, typer.Option(help="A flow sensor file (TOML).")] = None,
    vehicle: VehicleOption = None,
    ensemble: Annotated[
        bool | None,
        typer.Option(
            "--ensemble/--matched",
            help="Draw each flight's vehicle, wind and sensors, or fly what the filter is told; many flights draw.",
            show_default=False,
        ),
    ] = None,
    out: Annotated[Path | None, typer.Option(help="The record to write; out/SCENARIO.fnr where unsaid.")] = None,
    report: Annotated[bool, typer.Option("--report/--no-report", help="Write the HTML report beside it.")] = True,
    mavlink: Annotated[
        str | None, typer.Option(metavar="URL", help="Then tell the flight as a MAVLink autopilot (docs/live.md).")
    ] = None,
    speed: Annotated[float, typer.Option(help="Of the telling: 1 is real time.")] = 1.0,
    signing_key: Annotated[Path | None, typer.Option(help="Sign what is told: 32 bytes or 64 digits.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object and nothing else.")] = False,
) -> None:
    """Fly a scenario: the table of errors beside Table 5 or 6, touchdown, the record and its report."""
    from flownav.api.flying import MOST_FLIGHTS, MOST_SEED, fly_setup
    from flownav.api.parts import split
    from flownav.api.scenario import Scenario
    from flownav.cli.output import progress, require_between, require_writable_record, save
    from flownav.simulation.assemble import assemble

    require_between("--flights", flights, 1, MOST_FLIGHTS)
    require_between("--seed", seed, 0, MOST_SEED)
    require_between("--flight", flight or 0, 0, MOST_FLIGHTS)
    require_between("--speed", speed, 0.01, 100.0)
    if flight is not None and flights > 1:
        raise InputError("--flight names one flight, --flights many; give one of the two")
    parts, ours, _ = split(filter_name, (), None, None)
    chosen = Scenario.load(scenario).changed(
        gps=gps, filter=ours, autopilot=feedback, truth=truth, optics=optics, flow_sensor=sensor, vehicle=vehicle
    )
    record_path = out or Path("out") / f"{chosen.name}.fnr"
    setup = assemble(chosen.file)
    require_writable_record(record_path, scenario, sensor, vehicle, signing_key, report=report)
    dispersed = flights > 1 if ensemble is None else ensemble
    many = flights > 1 or parts.any or chosen.file.optics == "pixels"
    with progress(f"Flying {chosen.name}", flights) if many else nullcontext() as advance:
        flown = fly_setup(setup, seed, flight or 0, flights, dispersed=dispersed, parts=parts, progress=advance)
    facts = flown.facts | save(flown.record, record_path, report=report)
    if mavlink is not None:
        from flownav.api.telling import tell

        facts["told"] = tell(setup, flown.record, mavlink, speed, signing_key)
    if as_json:
        typer.echo(json.dumps(facts))
    else:
        from flownav.cli.flight_table import show

        show(facts, flown.record.manifest["paper"], flown.index)
    if int(facts["crashed"]) > CRASHES_ALLOWED * flights:
        raise VerdictError(f"{int(facts['crashed'])} of {flights} flights crashed (see `crashed` in docs/scenarios.md)")
