"""By how many of its standard deviations the height errs in flights in which nothing fails: what a level can be.

Flights and navigator are those of `tools/integrity.py`, from the hover on: sensors and vehicle as their sheets say, and
drawn for each flight. python tools/height_over_sigma.py [SEEDS]
"""

from __future__ import annotations

import sys

import numpy as np

from flownav.campaigns.faults.navigator import Navigate, navigator_with
from flownav.campaigns.faults.score import course_of
from flownav.campaigns.faults.table import BASE, HEIGHTS_M, flight_at, log_of, scenario_at, stood, window_start
from flownav.campaigns.local import fly_recorded
from flownav.core.measurement import Array
from flownav.logs.log import Log
from flownav.simulation.assemble import assemble
from flownav.simulation.scenario import load_scenario

LONGEST_S, FIRST_SEED, SEEDS = 5.0, 1000, 8


def drawn_flight(height_m: float, longest_s: float, seed: int) -> Log:
    """`flight_at` with vehicle and sensors of the flight's own."""
    setup = assemble(scenario_at(height_m, longest_s))
    return stood(log_of(fly_recorded(setup, seed, ensemble=setup.ensemble()), setup))


def sigmas(navigate: Navigate, log: Log, since_s: float) -> Array:
    """|Error of the height| over its standard deviation, from an instant on (n,)."""
    run = navigate(log.streams)
    course = course_of(run, log.truth or {})
    rows, after = np.searchsorted(run.t_s, course.t_s), course.t_s >= since_s
    found: Array = (np.abs(course.error_ned_m[:, 2]) / run.sigma_ned_m[rows, 2])[after]
    return found


def main(seeds: int) -> None:
    """Print the table."""
    fitted = assemble(load_scenario(BASE)).fitted
    assert fitted is not None
    navigate = navigator_with(fitted.given)
    print("| sensors and vehicle | flights | median | 95 % | 99.9 % | most |\n|---|---:|---:|---:|---:|---:|")
    for name, flight in (("as their sheets say", flight_at), ("drawn", drawn_flight)):
        each = [
            sigmas(navigate, flight(height_m, LONGEST_S, seed), window_start(height_m))
            for seed in range(FIRST_SEED, FIRST_SEED + seeds) for height_m in HEIGHTS_M
        ]  # fmt: skip
        all_of_them = np.concatenate(each)
        told = " | ".join(f"{value:.2f}" for value in (*np.percentile(all_of_them, [50, 95, 99.9]), all_of_them.max()))
        print(f"| {name} | {len(each)} | {told} |", flush=True)


if __name__ == "__main__":
    told_seeds = sys.argv[1:]
    if len(told_seeds) > 1 or not all(count.isdecimal() and int(count) > 0 for count in told_seeds):
        sys.exit("usage: python tools/height_over_sigma.py [SEEDS]")
    main(*map(int, told_seeds or [SEEDS]))
