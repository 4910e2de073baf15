"""The envelope: how surely a scenario lands, and how near, by the wind at 20 ft.

All flights of a row have the wind's speed as the row states it, and everything else drawn: its direction, the ground
that it comes over, vehicle and sensors. All rows have the same seed, so that their flights differ in the wind alone.

python tools/envelope.py [PAGE] [--scenario NAME]... [--speeds M/S...] [--flights N] [--seed S] prints a table, row by
row; `make envelope` writes it into a page.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from flownav.campaigns.local import fly_many
from flownav.core.files import written_whole
from flownav.core.measurement import Array
from flownav.scoring.errors import touchdown_rows
from flownav.scoring.landings import REST_DISTANCE, crashed, radius, succeeded
from flownav.simulation.assemble import Setup, assemble
from flownav.simulation.scenario import Scenario, load_scenario
from integrity import placed

SCENARIOS, SPEEDS_M_S = ("approach", "sortie"), (0.0, 2.0, 4.0, 6.0, 8.0, 10.0, 12.0, 13.5, 15.0)
FLIGHTS, SEED = 192, 54500
SPEED = "wind.speed_20ft_m_s"
BEGIN, END = "<!-- make envelope: begin -->", "<!-- make envelope: end -->"
HEADS = ("case", "wind at 20 ft [m/s]", "landed [%]", "crashed [%]", "R95 at rest [m]")


class Row(NamedTuple):
    """A scenario in one wind [m/s]: shares of its flights [%], R95 at rest [m] (NaN: too few land) with its interval
    (95 %, [m]; an end that is open is NaN).
    """

    case: str
    speed_m_s: float
    landed: float
    crashed: float
    r95_m: float = np.nan
    low_m: float = np.nan
    high_m: float = np.nan


# -- flights -----------------------------------------------------------------------------------------------------
def in_wind(scenario: Scenario, speed_m_s: float) -> Setup:
    """The scenario in a wind of exactly this speed at 20 ft, everything else drawn as it has it."""
    section = scenario.dispersion.model_copy(update={"fixed": (*scenario.dispersion.fixed, SPEED)})
    wind = scenario.wind.model_copy(update={"speed_20ft_m_s": speed_m_s})
    return assemble(scenario.model_copy(update={"wind": wind, "dispersion": section}))


def row_of(case: str, speed_m_s: float, landings: Array) -> Row:
    """The row of these touchdowns (flights, len(TOUCHDOWN_COLUMNS))."""
    rest = radius(landings, REST_DISTANCE)
    metres = [np.nan if value is None else float(value) for value in (rest["r95_m"], *rest["r95_interval_m"])]
    shares = [100.0 * float(np.mean(of(landings))) for of in (succeeded, crashed)]
    return Row(case, speed_m_s, *shares, *metres)


def rows(scenarios: Sequence[str], speeds_m_s: Sequence[float], flights: int, seed: int) -> Iterator[Row]:
    """Every scenario in every wind."""
    for name in scenarios:
        for speed_m_s in speeds_m_s:
            setup = in_wind(load_scenario(name), speed_m_s)
            flown = fly_many(setup.flight, seed, flights, ensemble=setup.ensemble())
            yield row_of(name, speed_m_s, touchdown_rows(flown))


# -- as a page ---------------------------------------------------------------------------------------------------
def heading(flights: int, seed: int) -> str:
    """The head of the table."""
    first, *others = HEADS
    heads = (f"{first} ({flights} flights a row, seed {seed})", *others)
    return f"| {' | '.join(heads)} |\n| --- |{' ---: |' * len(others)}\n"


def line(row: Row) -> str:
    """A row of the table."""
    low, high = (f"{end:.3f}" if np.isfinite(end) else "-" for end in (row.low_m, row.high_m))
    rest = f"{row.r95_m:.3f} ({low}-{high})" if np.isfinite(row.r95_m) else "none"
    return f"| `{row.case}` | {row.speed_m_s:g} | {row.landed:.1f} | {row.crashed:.1f} | {rest} |\n"


def main() -> None:
    """Fly, print and, where a page is named, write. InputError where the page lacks the marks."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("page", nargs="?", type=Path)
    parser.add_argument("--scenario", action="append", metavar="NAME")
    parser.add_argument("--speeds", nargs="+", type=float, default=SPEEDS_M_S, metavar="M/S")
    parser.add_argument("--flights", type=int, default=FLIGHTS)
    parser.add_argument("--seed", type=int, default=SEED)
    asked = parser.parse_args()
    if asked.page is not None:
        placed(asked.page.read_text(encoding="utf-8"), "", str(asked.page), BEGIN, END)
    text = heading(asked.flights, asked.seed)
    print(text, end="", flush=True)
    for row in rows(asked.scenario or SCENARIOS, asked.speeds, asked.flights, asked.seed):
        text += line(row)
        print(line(row), end="", flush=True)
    if asked.page is not None:
        page = placed(asked.page.read_text(encoding="utf-8"), text, str(asked.page), BEGIN, END)
        with written_whole(asked.page) as temporary:
            temporary.write_text(page, encoding="utf-8")


if __name__ == "__main__":
    main()
