"""`flownav fly`: a scenario flown in closed loop, scored beside the paper's tables."""

from __future__ import annotations

from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from flownav.cli import options
from flownav.cli.options import chosen, option, out_option, switch
from flownav.cli.output import answer, progress, record_place, require_between, save
from flownav.core.errors import InputError, VerdictError

if TYPE_CHECKING:
    from flownav.api.flying import Flights

CRASHES_ALLOWED = 0.05  # of the flights, before the exit status reports a bad verdict


GPS = "GPS errors: white noise as in the paper, or a receiver of 2 m CEP."
ON = "The state that the autopilot uses."
WIND = "Wind at 20 ft in m/s, with gusts, and where it blows from in degrees: 8:270."
PLANT = "The plant; linear is the paper's model."
CAMERA = "The pad camera; pixels renders its frames, which takes minutes a flight."
ONE_OR_MANY = "one flight matched, many an ensemble"
MAVLINK = "Then send the flight as a MAVLink autopilot would, for `flownav live`."
FAST = "How fast it is sent: 1 is real time."


def command(
    scenario: options.Scenario = "sortie",
    flights: Annotated[int, option("N", "How many flights; more than one gives medians and 5-95 %.")] = 1,
    flight: Annotated[int | None, option("K", "Fly only flight K of the seed, counted from 0.", unset="0")] = None,
    seed: options.Seed = 1,
    gps: Annotated[str | None, chosen(GPS, *options.GPS_MODELS, unset=options.SCENARIOS_OWN)] = None,
    wind: Annotated[str | None, option("SPEED[:FROM]", WIND, unset=options.SCENARIOS_OWN)] = None,
    filter_name: options.Filter = None,
    feedback: Annotated[str | None, chosen(ON, *options.FEEDBACKS, unset=options.SCENARIOS_OWN)] = None,
    truth: Annotated[str | None, chosen(PLANT, *options.PLANTS, unset=options.SCENARIOS_OWN)] = None,
    optics: Annotated[str | None, chosen(CAMERA, *options.OPTICS, unset=options.SCENARIOS_OWN)] = None,
    sensor: options.Sensor = None,
    vehicle: options.Vehicle = None,
    ensemble: Annotated[bool | None, switch(options.ENSEMBLE, "--ensemble/--matched", show_default=ONE_OR_MANY)] = None,
    out: Annotated[Path | None, out_option("The record", "out/SCENARIO.fnr")] = None,
    force: options.Force = False,
    report: options.Report = True,
    mavlink: Annotated[str | None, option("URL", MAVLINK)] = None,
    speed: Annotated[float, option("X", FAST, within=(0.01, 100.0))] = 1.0,
    signing_key: options.SigningKey = None,
    as_json: options.Json = False,
) -> None:
    """Fly a scenario: the table of errors beside Table 5 or 6, touchdown, the record and its report."""
    from flownav.core.compile import begin_in_parallel

    if filter_name is None and flights == 1:
        begin_in_parallel("flownav.navigation.take", "navigate_one")
    from flownav.api.calls import split
    from flownav.api.flying import MOST_FLIGHTS, fly_setup
    from flownav.api.scenario import Scenario
    from flownav.simulation.assemble import assemble

    require_between("--flights", flights, 1, MOST_FLIGHTS)
    require_between("--flight", flight or 0, 0, MOST_FLIGHTS)
    if flight is not None and flights > 1:
        raise InputError("--flight names one flight, --flights many; give one of the two")
    parts, ours, _ = split(filter_name, (), None, None)
    flow = str(sensor) if sensor else None
    chosen = Scenario.load(scenario).changed(
        gps=gps,
        wind=wind,
        filter=ours,
        autopilot=feedback,
        truth=truth,
        optics=optics,
        flow_sensor=flow,
        vehicle=vehicle,
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
    """The figures of the flights. VerdictError where too many crashed or never landed."""
    from flownav.cli.fly_output import show

    answer(facts, as_json, lambda: show(facts, flown.record.manifest, flown.index))
    if int(facts["crashed"]) > CRASHES_ALLOWED * flights:
        raise VerdictError(
            f"{int(facts['crashed'])} of {flights} flights crashed (see `crashed` in docs/reference/scenarios.md)"
        )
    from flownav.scoring.landings import WENT_AROUND

    landing = facts["touchdown"] or {}
    if "reason" in landing:
        raise VerdictError(f"{landing['verdict']}: {landing['reason']}")
    never = landing.get("unfinished", {}).get("never touched", 0) + landing.get("verdicts", {}).get(WENT_AROUND, 0)
    if never > CRASHES_ALLOWED * flights:
        raise VerdictError(f"{never} of {flights} flights never landed, or were aloft after a go-around at the end")
