"""`flownav fly`: a scenario flown in closed loop, scored beside the paper's tables."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from flownav.cli.output import VehicleOption
from flownav.errors import InputError, VerdictError

if TYPE_CHECKING:
    from flownav.record import Record
    from flownav.simulation.assemble import Setup
    from flownav.simulation.ensemble import Ensemble
    from flownav.simulation.scenario import Scenario


OF_MANY_FLIGHTS = ("rmse_over_bound", "anees_inside_fraction", "error_over_stated")
CRASHES_ALLOWED = 0.05  # of the flights, before the exit status says that the verdict is bad


def command(
    scenario: Annotated[
        str, typer.Argument(help="takeoff, landing, gusty, pad_return, approach, or a scenario file (TOML).")
    ],
    flights: Annotated[int, typer.Option(help="How many flights; more than one gives medians and 5-95 %.")] = 1,
    flight: Annotated[int | None, typer.Option(help="Fly this one flight of the seed again, counted from 0.")] = None,
    seed: Annotated[int, typer.Option(help="The campaign's noise; flight k of a seed is always the same flight.")] = 1,
    gps: Annotated[str | None, typer.Option(help="GPS error model: white or midg.")] = None,
    filter_name: Annotated[str | None, typer.Option("--filter", help="Filter: landing or paper.")] = None,
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
    from flownav.campaigns.judged import BOUND_FLIGHTS, bound_of, consistency_facts, fly_judged
    from flownav.campaigns.local import fly_recorded, known_exactly, median_flight
    from flownav.cli.output import progress, require_between, require_writable_record, save
    from flownav.scoring.errors import scores_of_flights
    from flownav.scoring.paper_tables import percentile_of_paper, published
    from flownav.scoring.takeoffs import takeoff_of_flights
    from flownav.simulation.assemble import assemble
    from flownav.simulation.scenario import load_scenario

    require_between("--flights", flights, 1, 10_000_000)
    require_between("--seed", seed, 0, 2**63 - 1)
    require_between("--flight", flight or 0, 0, 10_000_000)
    require_between("--speed", speed, 0.01, 100.0)
    if flight is not None and flights > 1:
        raise InputError("--flight names one flight, --flights many; give one of the two")
    chosen = _overridden(load_scenario(scenario), gps, filter_name, feedback, truth, optics, sensor, vehicle)
    record_path = out or Path("out") / f"{chosen.name}.fnr"
    setup = assemble(chosen)
    require_writable_record(record_path, scenario, sensor, vehicle, signing_key, report=report)
    dispersed = flights > 1 if ensemble is None else ensemble
    truths = setup.ensemble() if dispersed else None
    facts: dict[str, Any] = {
        "scenario": chosen.name,
        "filter": chosen.filter.name,
        "gps": chosen.gps.model,
        "truth": chosen.truth,
        "feedback": chosen.autopilot.feedback,
        "optics": chosen.optics,
        "truth_model": "ensemble" if dispersed else "matched",
        "seed": seed,
        "flights": flights,
    }
    index, percentiles = flight or 0, None
    if chosen.optics == "pixels":
        record, rows, facts["pad_frames"] = _fly_pixels(setup, seed, index, flights, truths)
    elif flights > 1:
        with progress(f"Flying {chosen.name}", flights) as advance:
            judged = fly_judged(setup.flight, seed, flights, ensemble=truths, on_progress=advance)
        rows = judged.scores
        index = median_flight(rows)
        if setup.fitted is not None:
            facts |= consistency_facts(judged, bound_of(setup, seed, min(flights, BOUND_FLIGHTS)))
        table = published(chosen.paper_table)
        percentiles = percentile_of_paper(rows, table) if table else None
    if chosen.optics == "model":
        record = fly_recorded(setup, seed, index, truths)
    scores = record.manifest["scores"] if flights == 1 else scores_of_flights(rows)
    if setup.fitted is not None:
        facts["known_exactly"] = known_exactly(chosen)
        facts |= dict.fromkeys(OF_MANY_FLIGHTS) if flights == 1 or chosen.optics == "pixels" else {}
    if flights > 1:
        flown = None if chosen.optics == "pixels" else judged.takeoffs
        scores["takeoff"] = None if flown is None else takeoff_of_flights(flown)
    facts |= scores | save(record, record_path, report=report)
    if percentiles:
        facts["paper_percentile"] = percentiles
    if mavlink is not None:
        facts["told"] = _tell(setup, record, mavlink, speed, signing_key)
    if as_json:
        typer.echo(json.dumps(facts))
    else:
        from flownav.cli.flight_table import show

        show(facts, record.manifest["paper"], index)
    if int(facts["crashed"]) > CRASHES_ALLOWED * flights:
        raise VerdictError(f"{int(facts['crashed'])} of {flights} flights crashed (see `crashed` in docs/scenarios.md)")


def _fly_pixels(
    setup: Setup, seed: int, first: int, flights: int, truths: Ensemble | None
) -> tuple[Record, Any, list[dict[str, Any]]]:
    """Flights on rendered frames, one after the other: the first one's record, their scores, frames by height."""
    import numpy as np

    from flownav.campaigns.local import fly_recorded, score_history
    from flownav.campaigns.pixels import agreement, fly_on_pixels
    from flownav.cli.output import progress
    from flownav.simulation.engine import fly_one

    records, scores, frames = [], [], []
    with progress("Flying on rendered frames", flights) as advance:
        for index in range(first, first + flights):
            seen, rendered = fly_on_pixels(setup, seed, index, truths)
            records.append(fly_recorded(seen, seed, index, truths))
            scores.append(score_history(seen.flight, fly_one(seen.flight, seed, index, truths))[0])
            frames += rendered
            advance(1)
    assert setup.fitted is not None
    assert setup.fitted.sheets.pad_camera is not None
    return records[0], np.array(scores), agreement(frames, setup.fitted.sheets.pad_camera)


def _tell(setup: Setup, record: Record, url: str, speed: float, key: Path | None) -> dict[str, Any]:
    """The flight as an autopilot tells it; how far it came, and what was heard."""
    from flownav.faults.flight_log import log_of
    from flownav.live.link import open_link
    from flownav.live.loop import run_vehicle, stoppable
    from flownav.live.simulated import SimulatedVehicle
    from flownav.mavlink.signing import load_key

    if "imu" not in record.tables or "gps_velocity" not in record.tables:
        raise InputError("--mavlink: the flight has no IMU or no GPS velocity; give --filter landing --gps midg")
    vehicle = SimulatedVehicle(log_of(record, setup), key=load_key(key) if key else None)
    link = open_link(url)
    try:
        with stoppable() as asked:
            reached_s = run_vehicle(vehicle, link, speed, asked)
    finally:
        link.close()
    return {"flight_s": min(reached_s, vehicle.end_s), "speed": speed, "heard": dict(vehicle.counts)}


def _overridden(
    scenario: Scenario,
    gps: str | None,
    filter_name: str | None,
    feedback: str | None,
    truth: str | None,
    optics: str | None,
    sensor: str | None,
    vehicle: str | None,
) -> Scenario:
    """The scenario with the command line's choices in place of its own, checked anew."""
    from flownav.parameter_files import check
    from flownav.simulation.scenario import Scenario

    entries = scenario.model_dump(exclude_unset=True)
    if gps is not None and gps != entries.get("gps", {}).get("model"):
        entries["gps"] = {"model": gps}
    if filter_name is not None:
        entries.setdefault("filter", {})["name"] = filter_name
    if feedback is not None:
        entries.setdefault("autopilot", {})["feedback"] = feedback
    if truth is not None:
        entries["truth"] = truth
    if optics is not None:
        entries["optics"] = optics
    if sensor is not None:
        entries["flow_sensor"] = sensor
    if vehicle is not None:
        entries["vehicle"] = entries.get("vehicle", {}) | {"file": vehicle}
    return check(entries, Scenario, "command line")
