"""A GPS position that is led off while its velocity stays right: when it is doubted, and how far it has led by then.

Flights and navigator are those of `tools/integrity.py`, from 1.5 and 3 m; a position that goes off at each rate for a
minute. Led off is how far the estimate moved against the same flight without. Doubted is `filter suspects`, or the
tenth fix that is refused. A second table follows such positions, and leaps, for longer, whoever doubts them: how far
they lead in all, and how often the estimate goes to them. python tools/gps_led_off.py [SEEDS]
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from flownav.campaigns.faults.catalogue import Fault
from flownav.campaigns.faults.inject import displaced
from flownav.campaigns.faults.navigator import Navigate, Navigated, navigator_with
from flownav.campaigns.faults.table import BASE, flight_at, window_start
from flownav.core.measurement import Array, Sensor
from flownav.simulation.assemble import assemble
from flownav.simulation.scenario import load_scenario

RATES_M_S = (0.2, 0.3, 0.5, 0.75, 1.0, 2.0, 5.0)
HEIGHTS_M, LASTS_S, FIRST_SEED, SEEDS = (1.5, 3.0), 60.0, 1000, 6
LONG_S, LATE_S = 90.0, 10.0  # of the second table: how long it lasts, and how long it is watched afterwards
GOES_ON = ((0.0, 0.2), (0.0, 0.5), (0.0, 1.0), (0.0, 2.0), (0.0, 5.0), (5.0, 0.0), (20.0, 0.0))  # leap [m], rate [m/s]
REFUSALS = 10  # that are a doubt: 2 s of a receiver of 5 Hz


class Led(NamedTuple):
    """One flight: when GPS was doubted [s after the fault began], NaN never; how far it had led by then [m]."""

    doubted_s: float
    led_m: float


def doubted_at(run: Navigated, t0_s: float) -> float:
    """When GPS position was doubted, in the time that the fault lasts; NaN never."""
    t1_s, offers = t0_s + LASTS_S, run.offers
    said = [event.t_s for event in run.events if (event.source, event.kind) == ("filter", "suspects")]
    refused = (offers.sensor == Sensor.GPS_POSITION) & (offers.component == 0) & ~offers.fused
    times = np.sort(offers.t_s[refused & (offers.t_s > t0_s)])
    found = [t_s for t_s in (*said, *times[REFUSALS - 1 : REFUSALS]) if t0_s < t_s < t1_s]
    return float(min(found, default=np.nan))


def led(without: Navigated, run: Navigated, instants: Array) -> Array:
    """How far the estimate lies from that of the flight without the fault, horizontally, at the instants (n,) [m]."""
    north, east = (
        np.interp(instants, run.t_s, run.position_ned_m[:, axis])
        - np.interp(instants, without.t_s, without.position_ned_m[:, axis])
        for axis in range(2)
    )
    return np.hypot(north, east)


def flown(navigate: Navigate, rate_m_s: float, seeds: int) -> Iterator[Led]:
    """Every seed at every height."""
    fault = Fault("led off", "", (Sensor.GPS_POSITION,), displaced(0.0, rate_m_s))
    for seed in range(FIRST_SEED, FIRST_SEED + seeds):
        for height_m in HEIGHTS_M:
            streams, t0_s = flight_at(height_m, LASTS_S, seed).streams, window_start(height_m)
            without, run = navigate(streams), navigate(fault.inject(streams, t0_s, t0_s + LASTS_S, seed))
            at_s = doubted_at(run, t0_s)
            until_s = t0_s + LASTS_S if np.isnan(at_s) else at_s
            instants = run.t_s[(run.t_s > t0_s) & (run.t_s < until_s)]
            led_m = led(without, run, instants)
            yield Led(at_s - t0_s, float(led_m.max(initial=0.0)))


def row(rate_m_s: float, found: list[Led]) -> str:
    """A rate's row."""
    doubted_s, led_m = (np.array(values) for values in zip(*found, strict=True))
    after = doubted_s[np.isfinite(doubted_s)]
    when = f"{np.median(after):.1f}" if len(after) else "-"
    within = f"{100.0 * np.mean(led_m < 1.0):.0f}"
    return (
        f"| {rate_m_s:g} | {len(found)} | {100.0 * len(after) / len(found):.0f} | {when} | {np.median(led_m):.2f} | "
        f"{led_m.max():.2f} | {within} |"
    )


def long_row(navigate: Navigate, leap_m: float, rate_m_s: float, seeds: int) -> str:
    """A leap's or rate's row of the second table."""
    fault = Fault("goes on", "", (Sensor.GPS_POSITION,), displaced(leap_m, rate_m_s))
    most_m, went = [], []
    for seed in range(FIRST_SEED, FIRST_SEED + seeds):
        for height_m in HEIGHTS_M:
            streams, t0_s = flight_at(height_m, LONG_S, seed).streams, window_start(height_m)
            without, run = navigate(streams), navigate(fault.inject(streams, t0_s, t0_s + LONG_S, seed))
            ends_s = t0_s + LONG_S + LATE_S
            most_m.append(led(without, run, run.t_s[(run.t_s > t0_s) & (run.t_s < ends_s)]).max(initial=0.0))
            went.append(sum((e.source, e.kind) == ("gps", "reset") and t0_s < e.t_s < ends_s for e in run.events))
    return (
        f"| {leap_m:g} | {rate_m_s:g} | {len(most_m)} | {np.median(most_m):.2f} | {max(most_m):.2f} | "
        f"{np.mean(went):.1f} |"
    )


def main(seeds: int) -> None:
    """Print the table."""
    fitted = assemble(load_scenario(BASE)).fitted
    assert fitted is not None
    navigate = navigator_with(fitted.given)
    print("| rate [m/s] | flights | doubted [%] | after, median [s] | led off, median [m] | most [m] | < 1 m [%] |")
    print("|---:|---:|---:|---:|---:|---:|---:|")
    for rate_m_s in RATES_M_S:
        print(row(rate_m_s, list(flown(navigate, rate_m_s, seeds))), flush=True)
    print("\n| leap [m] | rate [m/s] | flights | led off at most, median [m] | most [m] | goes to it, times |")
    print("|---:|---:|---:|---:|---:|---:|")
    for leap_m, rate_m_s in GOES_ON:
        print(long_row(navigate, leap_m, rate_m_s, seeds), flush=True)


if __name__ == "__main__":
    told = sys.argv[1:]
    if len(told) > 1 or not all(count.isdecimal() and int(count) > 0 for count in told):
        sys.exit("usage: python tools/gps_led_off.py [SEEDS]")
    main(*map(int, told or [SEEDS]))
