"""Fly drawn vehicles, identify each from its record, and print how often the 95 % intervals hold the truth.

python tools/vehicle_coverage.py [--flights 200] [--seed 9541] [--scenario approach]

The truth of a flight is its drawn vehicle: the stiffnesses, the flapping rate and the lag of its own parameters.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from flownav.control.design import nominal_model
from flownav.core.compile import LANES
from flownav.lab.identification.commanded import on_one_clock, source_of_record
from flownav.lab.identification.vehicle_parameters import identify_vehicle
from flownav.simulation.assemble import Setup, assemble
from flownav.simulation.engine import fly_written
from flownav.simulation.flight_record import record_of
from flownav.simulation.scenario import load_scenario
from flownav.vehicle.kinds import AnyVehicle, load_vehicle
from flownav.vehicle.trim import trim


def truth_of(vehicle: AnyVehicle) -> dict[str, float]:
    """A helicopter's parameters as `identify --vehicle` names them."""
    own = nominal_model(vehicle, trim(vehicle), -1)
    return {
        "pitch_stiffness_1_s2": own.pitch_stiffness_1_s2,
        "roll_stiffness_1_s2": own.roll_stiffness_1_s2,
        "pitch_rate_by_cyclic_1_s": own.flap_rate_1_s,
        "lag_s": 1.0 / own.flap_rate_1_s + 2.0 * own.servo_damping / own.servo_rad_s,
    }


def flights(setup: Setup, seed: int, count: int) -> Iterator[dict[str, tuple[float, float, float, float]]]:
    """Of each flight by parameter: value, low, high, truth; NaN where it has no number."""
    ensemble, stated, nothing = setup.ensemble(), load_vehicle(), (float("nan"),) * 3
    for first in range(0, count, len(LANES)):
        flown = fly_written(setup.flight, seed, first, LANES, ensemble)
        truths = ensemble.truths(seed, first, len(LANES))
        for lane, truth in enumerate(truths[: count - first]):
            name = Path(f"flight {first + lane}")
            record = record_of(setup, flown, seed, first + lane, lane)
            found = identify_vehicle(on_one_clock(name, source_of_record(name, record)), stated)
            yield {key: (*(found.interval(key) or nothing), true) for key, true in truth_of(truth.vehicle).items()}


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--flights", type=int, default=200)
    parser.add_argument("--seed", type=int, default=9541)
    parser.add_argument("--scenario", default="approach")
    given = parser.parse_args()
    rows = list(flights(assemble(load_scenario(given.scenario)), given.seed, given.flights))
    print(f"{len(rows)} flights of {given.scenario}, seed {given.seed}")
    total, known = 0, 0
    for key in rows[0]:
        value, low, high, true = np.array([row[key] for row in rows]).T
        shown = np.isfinite(value)
        inside = int(np.sum((low <= true) & (true <= high)))
        off = np.abs(value / true - 1.0)[shown]
        half = ((high - low) / (2.0 * value))[shown]
        total, known = total + inside, known + int(shown.sum())
        print(
            f"{key:26} {inside} of {shown.sum()} hold ({100.0 * inside / shown.sum():.1f} %), "
            f"half width {100.0 * np.median(half):.1f} %, off {100.0 * np.median(off):.1f} % in the median"
        )
    print(f"all: {100.0 * total / known:.1f} %")


if __name__ == "__main__":
    main()
