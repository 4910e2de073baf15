"""`flownav fly`: a scenario flown in closed loop, scored beside the paper's tables."""

from __future__ import annotations

from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from flownav.cli.choices import FEEDBACKS, GPS_MODELS, OPTICS, PLANTS, one_of, option
from flownav.cli.options import (
    ENSEMBLE,
    SCENARIOS_OWN,
    FilterOption,
    ForceOption,
    JsonOption,
    ReportOption,
    ScenarioArgument,
    SeedOption,
    SensorOption,
    SigningKeyOption,
    VehicleOption,
    out_option,
)
from flownav.cli.output import emit
from flownav.core.errors import InputError, VerdictError

if TYPE_CHECKING:
    from flownav.api.flying import Flights

CRASHES_ALLOWED = 0.05  # of the flights, before the exit status says that the verdict is bad


FlightOption = Annotated[
    int | None, option("K", "Fly only flight K of the seed, counted from 0.", "--flight", unset="0")
]
GPS = "GPS errors: white noise as in the paper, or a receiver of 2 m CEP."
GpsOption = Annotated[str | None, typer.Option(help=GPS, show_default=SCENARIOS_OWN, **one_of(*GPS_MODELS))]
FeedbackOption = Annotated[
    str | None, typer.Option(help="What the autopilot flies on.", show_default=SCENARIOS_OWN, **one_of(*FEEDBACKS))
]
PLANT = "The plant; linear is the paper's model."
TruthOption = Annotated[str | None, typer.Option(help=PLANT, show_default=SCENARIOS_OWN, **one_of(*PLANTS))]
CAMERA = "The pad camera; pixels renders its frames, which takes minutes a flight."
OpticsOption = Annotated[str | None, typer.Option(help=CAMERA, show_default=SCENARIOS_OWN, **one_of(*OPTICS))]
OneOrManyOption = Annotated[
    bool | None,
    typer.Option("--ensemble/--matched", help=ENSEMBLE, show_default="one flight matched, many an ensemble"),
]
MAVLINK = "Then send the flight as a MAVLink autopilot would, for `flownav live`."
SpeedOption = Annotated[float, option("X", "How fast it is sent: 1 is real time.", within=(0.01, 100.0))]


def command(
    scenario: ScenarioArgument,
    flights: Annotated[int, option("N", "How many flights; more than one gives medians and 5-95 %.")] = 1,
    flight: FlightOption = None,
    seed: SeedOption = 1,
    gps: GpsOption = None,
    filter_name: FilterOption = None,
    feedback: FeedbackOption = None,
    truth: TruthOption = None,
    optics: OpticsOption = None,
    sensor: SensorOption = None,
    vehicle: VehicleOption = None,
    ensemble: OneOrManyOption = None,
    out: Annotated[Path | None, out_option("The record", "out/SCENARIO.fnr")] = None,
    force: ForceOption = False,
    report: ReportOption = True,
    mavlink: Annotated[str | None, option("URL", MAVLINK)] = None,
    speed: SpeedOption = 1.0,
    signing_key: SigningKeyOption = None,
    as_json: JsonOption = False,
) -> None:
    """Fly a scenario: the table of errors beside Table 5 or 6, touchdown, the record and its report."""
    from flownav.api.calls import split
    from flownav.api.flying import MOST_FLIGHTS, fly_setup
    from flownav.api.scenario import Scenario
    from flownav.cli.output import progress, record_place, require_between, save
    from flownav.simulation.assemble import assemble

    require_between("--flights", flights, 1, MOST_FLIGHTS)
    require_between("--flight", flight or 0, 0, MOST_FLIGHTS)
    if flight is not None and flights > 1:
        raise InputError("--flight names one flight, --flights many; give one of the two")
    parts, ours, _ = split(filter_name, (), None, None)
    flow = str(sensor) if sensor else None
    chosen = Scenario.load(scenario).changed(
        gps=gps, filter=ours, autopilot=feedback, truth=truth, optics=optics, flow_sensor=flow, vehicle=vehicle
    )
    setup = assemble(chosen.file)
    asked = out or Path("out") / f"{chosen.name}.fnr"
    record_path = record_place(asked, scenario, sensor, vehicle, signing_key, force=force, report=report)
    dispersed = flights > 1 if ensemble is None else ensemble
    many = flights > 1 or parts.any or chosen.file.optics == "pixels"
    with progress(f"Flying {chosen.name}", flights) if many else nullcontext() as advance:
        flown = fly_setup(setup, seed, flight or 0, flights, dispersed=dispersed, parts=parts, progress=advance)
    facts = flown.facts | save(flown.record, record_path, report=report)
    if mavlink is not None:
        from flownav.api.flying import tell

        facts["told"] = tell(setup, flown.record, mavlink, speed, signing_key)
    _say(facts, flown, flights, as_json)


def _say(facts: dict[str, Any], flown: Flights, flights: int, as_json: bool) -> None:
    """The figures of the flights. VerdictError where too many crashed."""
    if as_json:
        emit(facts)
    else:
        from flownav.cli.flight_table import show

        show(facts, flown.record.manifest["paper"], flown.index)
    if int(facts["crashed"]) > CRASHES_ALLOWED * flights:
        raise VerdictError(
            f"{int(facts['crashed'])} of {flights} flights crashed (see `crashed` in docs/reference/scenarios.md)"
        )
