"""The assumptions that the landing's R95 rests on: each is worsened alone, and the same flights are flown again.

Only the truth gets worse: datasheets, navigator and autopilot stay, as with a sensor or a place that is worse than its
sheet. All rows have the same seed, so that their flights differ in the one number alone.

python tools/sceptic.py [--scenario NAME] [--flights N] [--seed S] prints a table, row by row.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Mapping
from typing import NamedTuple

import numpy as np

from flownav.campaigns.local import fly_many
from flownav.core.measurement import Array
from flownav.core.parameter_files import check
from flownav.scoring.errors import touchdown_rows
from flownav.scoring.landings import REST_DISTANCE, crashed, radius, succeeded
from flownav.simulation.assemble import assemble
from flownav.simulation.dispersion import DispersionSection, Distribution
from flownav.simulation.scenario import Scenario, load_scenario

SCENARIO, FLIGHTS, SEED = "approach", 192, 54300
NARROW = 1e-9  # the width of a distribution that stands for one number
LEVELS = tuple(
    f"inertial.vibration.{part}.{axis}" for part in ("rotor", "blades")
    for axis in ("level_m_s2", "vertical_m_s2", "tilt_deg_s", "yaw_deg_s")
)  # fmt: skip
PAD_NOISE = tuple(
    f"pad_camera.{what}" for what in (
        "angle.floor_mrad", "angle.per_m_mrad", "angle.per_rad_s_mrad",
        "distance.floor_percent", "distance.per_m_percent", "distance.per_rad_s_percent",
    )
)  # fmt: skip


class Assumption(NamedTuple):
    """An assumption that is worsened, in words, and the numbers drawn in its place, by dotted name."""

    words: str
    drawn: Mapping[str, Distribution]


def number(value: float, mode: str = "value") -> Distribution:
    """The same number in each flight."""
    return check(
        {"distribution": "uniform", "loc": value, "scale": NARROW, "mode": mode}, Distribution, "tools/sceptic"
    )


def evenly(least: float, most: float, mode: str = "factor") -> Distribution:
    """Anything between two numbers."""
    return check(
        {"distribution": "uniform", "loc": least, "scale": most - least, "mode": mode}, Distribution, "tools/sceptic"
    )


ASSUMPTIONS = (
    Assumption("pad camera: noise x 3", dict.fromkeys(PAD_NOISE, number(3.0, "factor"))),
    Assumption("pad camera: 80 ms later than its sheet", {"pad_camera.latency_s": evenly(0.06, 0.12, "offset")}),
    Assumption("pad camera: 2 % of fixes false", {"pad_camera.false_share": number(0.02)}),
    Assumption("pad camera: boresight x 3", {"pad_camera.boresight_deg": evenly(1.5, 4.5)}),
    Assumption(
        "compass: hard iron x 10 (80 mgauss, a steel deck)", {"magnetometer.hard_iron_mgauss": number(10.0, "factor")}
    ),
    Assumption(
        "stamps: pad, flow, range and GPS another 50 ms late",
        {
            "pad_camera.latency_s": evenly(0.03, 0.09, "offset"),
            "flow_camera.latency_s": evenly(0.05, 0.06, "offset"),
            "range_sensor.latency_s": evenly(0.05, 0.051, "offset"),
            "gps_receiver.latency_s": evenly(-0.01, 0.11, "offset"),
        },
    ),
    Assumption(
        "recirculation x 3, its loss and its unsteadiness",
        {"recirculation.loss": evenly(0.0, 6.0), "recirculation.unsteady": evenly(0.0, 6.0)},
    ),
    Assumption(
        "flow: false matches x 20 (10 %, a pattern that repeats)",
        {"flow_camera.outliers.share": number(20.0, "factor")},
    ),
    Assumption("skids: friction 0.2", {"vehicle.skids.friction_coefficient": number(0.2)}),
    Assumption("vibration x 2", dict.fromkeys(LEVELS, number(2.0, "factor"))),
    Assumption("cyclic servos: dead band x 3", {"vehicle.cyclic.dead_band_deg": number(3.0, "factor")}),
)  # fmt: skip


def worsened(scenario: Scenario, drawn: Mapping[str, Distribution]) -> Scenario:
    """The scenario with these numbers drawn so, and all others as it has them. InputError where one is unknown."""
    section = DispersionSection(
        file=scenario.dispersion.file,
        fixed=tuple(name for name in scenario.dispersion.fixed if name not in drawn),
        parameters={**scenario.dispersion.parameters, **drawn},
    )
    return scenario.model_copy(update={"dispersion": section})


def landings_of(scenario: Scenario, flights: int, seed: int) -> Array:
    """The touchdowns of an ensemble's flights (flights, len(TOUCHDOWN_COLUMNS))."""
    setup = assemble(scenario)
    return touchdown_rows(fly_many(setup.flight, seed, flights, ensemble=setup.ensemble()))


def row(words: str, landings: Array, before_m: float | None) -> tuple[str, float | None]:
    """A row of the table, and its R95 at rest [m]; before_m: that of the flights as they are."""
    rest = radius(landings, REST_DISTANCE)
    low, high = ("-" if bound is None else f"{bound:.3f}" for bound in rest["r95_interval_m"])
    r95_m = rest["r95_m"]
    value = "none" if r95_m is None else f"{r95_m:.3f} ({low}-{high})"
    change = "" if r95_m is None or before_m is None else f"{100.0 * (r95_m / before_m - 1.0):+.0f} %"
    landed, broken = 100.0 * float(np.mean(succeeded(landings))), int(crashed(landings).sum())
    return f"| {words} | {value} | {change} | {landed:.1f} | {broken} |", r95_m


def rows(name: str, flights: int, seed: int) -> Iterator[str]:
    """The table's rows: the flights as they are, and with each assumption worsened."""
    scenario = load_scenario(name)
    first, before_m = row("as they are", landings_of(scenario, flights, seed), None)
    yield first
    for each in ASSUMPTIONS:
        yield row(each.words, landings_of(worsened(scenario, each.drawn), flights, seed), before_m)[0]


def main() -> None:
    """Fly and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenario", default=SCENARIO)
    parser.add_argument("--flights", type=int, default=FLIGHTS)
    parser.add_argument("--seed", type=int, default=SEED)
    asked = parser.parse_args()
    flown = f"{asked.scenario}, {asked.flights} flights, seed {asked.seed}"
    print(f"| worsened ({flown}) | R95 at rest [m] | change | landed [%] | crashed |")
    print("|---|---|---|---|---|", flush=True)
    for line in rows(asked.scenario, asked.flights, asked.seed):
        print(line, flush=True)


if __name__ == "__main__":
    main()
