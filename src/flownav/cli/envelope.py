"""`flownav envelope`: how surely a scenario lands, over the wind's speed and direction."""

from pathlib import Path
from typing import Annotated, Any

import typer

from flownav.cli import options
from flownav.cli.options import numbers, option, out_option
from flownav.cli.tables import answer, say, table

SPEEDS_M_S = ["2,4,6,8,10"]


def command(
    scenario: options.Scenario,
    speeds: Annotated[list[str], option("M/S", "Wind speeds at 20 ft [m/s], repeated or with commas.")] = SPEEDS_M_S,
    directions: Annotated[int, option("N", "How many directions the wind blows from, from north on.")] = 8,
    vehicle: options.Vehicle = None,
    flights: Annotated[int, option("N", "Flights of each speed and direction.")] = 32,
    seed: options.Seed = 1,
    ensemble: options.Ensemble = True,
    out: Annotated[Path | None, out_option("The page (HTML)", "out/SCENARIO_envelope.html")] = None,
    force: options.Force = False,
    as_json: options.Json = False,
) -> None:
    """Fly a scenario in winds of many speeds and directions: a table and a polar map of the share that landed."""
    from flownav.campaigns.local import directions_deg, fly_envelope
    from flownav.cli.output import place, progress, require_between, writing
    from flownav.core.errors import InputError
    from flownav.report.campaign import write_envelope
    from flownav.simulation.scenario import load_scenario, with_vehicle

    require_between("--flights", flights, 1, 1_000_000)
    require_between("--directions", directions, 1, 360)
    chosen_speeds = sorted(set(numbers("--speeds", speeds, 0.1, 30.0)))
    chosen = with_vehicle(load_scenario(scenario), vehicle)
    last_s = chosen.flight.may_land_after_s
    if last_s is None or last_s >= chosen.flight.duration_s or chosen.truth == "linear":
        raise InputError(f"{chosen.name}: it never lands; give a scenario with a may_land_after_s before its end")
    page = place(out or Path("out") / f"{chosen.name}_envelope.html", scenario, vehicle, force=force)
    with progress(f"Flying {chosen.name}", flights * directions * len(chosen_speeds)) as advance:
        rows = fly_envelope(
            chosen, chosen_speeds, directions_deg(directions), seed, flights, dispersed=ensemble, on_progress=advance
        )
    model = "ensemble" if ensemble else "matched"
    named = f", {vehicle}" if vehicle else ""
    title = f"{chosen.name}{named}, {model}, {flights} flights a field, seed {seed}"
    with writing(page):
        write_envelope(title, rows, page)
    facts = {"scenario": chosen.name, "vehicle": vehicle, "truth_model": model, "flights": flights, "seed": seed}
    answer(facts | {"cells": rows, "out": str(page)}, as_json, lambda: _show(title, rows, page))


def _show(title: str, rows: list[dict[str, Any]], page: Path) -> None:
    """Landed [%] by speed (rows) and direction (columns)."""
    directions = sorted({row["from_direction_deg"] for row in rows})
    lines = []
    for speed in sorted({row["speed_20ft_m_s"] for row in rows}):
        ring = {row["from_direction_deg"]: row["success"]["rate"] for row in rows if row["speed_20ft_m_s"] == speed}
        lines.append((f"{speed:g}", *(f"{100.0 * ring[direction]:.0f}" for direction in directions)))
    heads = ("wind at 20 ft [m/s]", *(f"from {direction:g} deg [%]" for direction in directions))
    wide = max(len(title) + 16, 26 + 19 * len(directions))
    say(f"landed [%], {title}", table(heads, lines, left=1), wide=wide)
    typer.echo(f"page  {page}")
