"""A GPS position that is led off while its velocity stays right: when it is doubted, how far it has led by then, and
whether the protection level holds meanwhile.

Flights and navigator are those of `tools/integrity.py`. The first table is of flights from 1.5 and 3 m with a position
that goes off at each rate for a minute. Led off is how far the estimate moved against the same flight without. Doubted
is `filter suspects`, or the tenth fix that is refused. The second follows such positions, and leaps, for 90 s, whoever
doubts them: how far they lead in all, and how often the estimate goes to them. The others count as `make integrity`
does, for drifts and a leap of 5 s and of a minute. `make integrity` writes them into a page:
python tools/gps_led_off.py PAGE [SEEDS]
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np

from flownav.campaigns.faults.catalogue import Fault
from flownav.campaigns.faults.inject import displaced
from flownav.campaigns.faults.navigator import Navigate, Navigated, navigator_with
from flownav.campaigns.faults.table import BASE, DURATIONS_S, flight_at, window_start
from flownav.core.errors import FlownavError
from flownav.core.files import written_whole
from flownav.core.measurement import Array, Sensor
from flownav.simulation.assemble import assemble
from flownav.simulation.scenario import load_scenario
from integrity import LONG_S, counted, fly, placed, rows_of, table

RATES_M_S = (0.2, 0.3, 0.5, 0.75, 1.0, 2.0, 5.0)
HEIGHTS_M, LASTS_S, FIRST_SEED, SEEDS = (1.5, 3.0), 60.0, 1000, 6
GOES_ON_S, LATE_S = 90.0, 10.0  # of the second table: how long it lasts, and how long it is watched afterwards
GOES_ON = ((0.0, 0.2), (0.0, 0.5), (0.0, 1.0), (0.0, 2.0), (0.0, 5.0), (5.0, 0.0), (20.0, 0.0))  # leap [m], rate [m/s]
REFUSALS = 10  # that are a doubt: 2 s of a receiver of 5 Hz
LEVEL_SEEDS = 4
LEAP_M = 20.0  # beside good flow
BEGIN, END = "<!-- make integrity, led off: begin -->", "<!-- make integrity, led off: end -->"


class Led(NamedTuple):
    """One flight: when GPS was doubted [s after the fault began], NaN never; how far it had led by then [m]."""

    doubted_s: float
    led_m: float


def led_off(rate_m_s: float) -> Fault:
    """A position that goes off at this rate, its velocity right."""
    return Fault(f"{rate_m_s:g}_m_s", "", (Sensor.GPS_POSITION,), displaced(0.0, rate_m_s))


def leap() -> Fault:
    """A position that leaps and stays, its velocity right."""
    return Fault(f"leap_of_{LEAP_M:g}_m", "", (Sensor.GPS_POSITION,), displaced(LEAP_M, 0.0))


def led(without: Navigated, run: Navigated, instants: Array) -> Array:
    """How far the estimate lies from that of the flight without the fault, horizontally, at the instants (n,) [m]."""
    north, east = (
        np.interp(instants, run.t_s, run.position_ned_m[:, axis])
        - np.interp(instants, without.t_s, without.position_ned_m[:, axis])
        for axis in range(2)
    )
    return np.hypot(north, east)


def doubted_at(run: Navigated, t0_s: float) -> float:
    """When GPS position was doubted, in the time that the fault lasts; NaN never."""
    t1_s, offers = t0_s + LASTS_S, run.offers
    said = [event.t_s for event in run.events if (event.source, event.kind) == ("filter", "suspects")]
    refused = (offers.sensor == Sensor.GPS_POSITION) & (offers.component == 0) & ~offers.fused
    times = np.sort(offers.t_s[refused & (offers.t_s > t0_s)])
    found = [t_s for t_s in (*said, *times[REFUSALS - 1 : REFUSALS]) if t0_s < t_s < t1_s]
    return float(min(found, default=np.nan))


def flown(navigate: Navigate, rate_m_s: float, seeds: int) -> Iterator[Led]:
    """Every seed at every height."""
    fault = led_off(rate_m_s)
    for seed in range(FIRST_SEED, FIRST_SEED + seeds):
        for height_m in HEIGHTS_M:
            streams, t0_s = flight_at(height_m, LASTS_S, seed).streams, window_start(height_m)
            without, run = navigate(streams), navigate(fault.inject(streams, t0_s, t0_s + LASTS_S, seed))
            at_s = doubted_at(run, t0_s)
            until_s = t0_s + LASTS_S if np.isnan(at_s) else at_s
            instants = run.t_s[(run.t_s > t0_s) & (run.t_s < until_s)]
            yield Led(at_s - t0_s, float(led(without, run, instants).max(initial=0.0)))


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
            streams, t0_s = flight_at(height_m, GOES_ON_S, seed).streams, window_start(height_m)
            without, run = navigate(streams), navigate(fault.inject(streams, t0_s, t0_s + GOES_ON_S, seed))
            ends_s = t0_s + GOES_ON_S + LATE_S
            most_m.append(led(without, run, run.t_s[(run.t_s > t0_s) & (run.t_s < ends_s)]).max(initial=0.0))
            went.append(sum((e.source, e.kind) == ("gps", "reset") and t0_s < e.t_s < ends_s for e in run.events))
    return (
        f"| {leap_m:g} | {rate_m_s:g} | {len(most_m)} | {np.median(most_m):.2f} | {max(most_m):.2f} | "
        f"{np.mean(went):.1f} |"
    )


LED_HEADINGS = (
    "| rate [m/s] | flights | doubted [%] | after, median [s] | led off, median [m] | most [m] | < 1 m [%] |\n"
    "|---:|---:|---:|---:|---:|---:|---:|\n"
)
LONG_HEADINGS = (
    "| leap [m] | rate [m/s] | flights | led off at most, median [m] | most [m] | goes to it, times |\n"
    "|---:|---:|---:|---:|---:|---:|\n"
)


def section(navigate: Navigate, seeds: int, level_seeds: int) -> str:
    """The tables with how they were made: when it is doubted, and how often the error is above the level."""
    short = "".join(f"{row(rate_m_s, list(flown(navigate, rate_m_s, seeds)))}\n" for rate_m_s in RATES_M_S)
    long = "".join(f"{long_row(navigate, leap_m, rate_m_s, seeds)}\n" for leap_m, rate_m_s in GOES_ON)
    faults = (*(led_off(rate_m_s) for rate_m_s in (0.1, *RATES_M_S)), leap())
    few, found = range(FIRST_SEED, FIRST_SEED + level_seeds), []
    for lasts_s in (DURATIONS_S[-1], LONG_S):
        rows = rows_of(counted(fly(navigate, few, (), faults, durations_s=(lasts_s,))))
        found.append(f"Errors above the protection level, position led off for {lasts_s:g} s:\n\n{table(rows)}")
    lasts = f"For {GOES_ON_S:g} s, and {LATE_S:g} s afterwards, whoever doubts it:"
    led_off_m = f"{LED_HEADINGS}{short}\n{lasts}\n\n{LONG_HEADINGS}{long}\n"
    return f"Printed by `make integrity`, seeds from {FIRST_SEED}.\n\n{led_off_m}" + "\n".join(found)


def main(page: Path, seeds: int = SEEDS, level_seeds: int = LEVEL_SEEDS) -> None:
    """Fly, print and write the tables. FlownavError where the page has no place for them."""
    text = page.read_text(encoding="utf-8")
    placed(text, "", str(page), BEGIN, END)
    fitted = assemble(load_scenario(BASE)).fitted
    assert fitted is not None
    found = section(navigator_with(fitted.given), seeds, level_seeds)
    print(found)
    with written_whole(page) as temporary:
        temporary.write_text(placed(text, found, str(page), BEGIN, END), encoding="utf-8", newline="\n")


if __name__ == "__main__":
    told = sys.argv[1:]
    if len(told) not in (1, 2, 3) or not all(count.isdecimal() and int(count) > 0 for count in told[1:]):
        sys.exit("usage: python tools/gps_led_off.py PAGE [SEEDS of the first table [SEEDS of the others]]")
    try:
        main(Path(told[0]), *map(int, told[1:]))
    except (FlownavError, OSError) as error:
        sys.exit(f"flownav: {error}")
