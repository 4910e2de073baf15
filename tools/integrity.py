"""Protection levels on trial: flights with a failing sensor, and how often the error is above the level without a
warning.

Flights are those of `campaigns.faults.table`; the error is that of the estimate at its own instants, from the fault's
begin on. `make integrity` writes them as a table into a page: python tools/integrity.py PAGE
"""

from __future__ import annotations

import sys
import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flownav.campaigns.faults.catalogue import DEGREE_S, FAULTS, Fault
from flownav.campaigns.faults.inject import biased
from flownav.campaigns.faults.navigator import Navigate, Navigated, navigator_with, started
from flownav.campaigns.faults.score import course_of
from flownav.campaigns.faults.table import (
    AFTER_S,
    BASE,
    DURATIONS_S,
    HEIGHTS_M,
    NO_FAULT,
    durations_of,
    flight_at,
    longest,
    window_start,
)
from flownav.core.errors import FlownavError, InputError
from flownav.core.files import written_whole
from flownav.core.measurement import Array, Sensor, Stream
from flownav.core.record import Table
from flownav.core.version import __version__
from flownav.estimation.states import HYPOTHESES
from flownav.navigation.flags import flagged
from flownav.navigation.loop import run
from flownav.navigation.settings_of import GivenSettings
from flownav.navigation.tape import EVENT_NAMES, FAULT_SUSPECTED
from flownav.simulation.assemble import assemble
from flownav.simulation.scenario import load_scenario

SUSPECTS = " ".join(EVENT_NAMES[int(FAULT_SUSPECTED)][:2])
TOGETHER = "all faults"
FIRST_SEED = 1000  # levels and suspicions were looked at with lower ones while they were made
FAULTY_SEEDS, CLEAN_SEEDS = 75, 334  # 10 125 flights with a fault, 1002 without
LONG_S, LONG_SEEDS = 60.0, 10  # faults that last, in 690 flights more
AFTERWARDS_S = 10.0  # chosen
_PARTS = {
    "accelerometer down": (0.0, 0.0, 0.0, 0.0, 0.0, 0.3), "accelerometer level": (0.0, 0.0, 0.0, 0.3, 0.3, 0.0),
    "gyro down": (0.0, 0.0, DEGREE_S, 0.0, 0.0, 0.0), "gyro level": (DEGREE_S, DEGREE_S, 0.0, 0.0, 0.0, 0.0),
}  # fmt: skip
# of `imu_bias`, each alone
PARTS = tuple(
    Fault(f"imu_bias, {name}", name, (Sensor.IMU,), biased(bias[:3], bias[3:])) for name, bias in _PARTS.items()
)


class Judged(NamedTuple):
    """One flight from the instant t0 on, (n,) steps of the estimate.

    error_m, level_m (n, 2): horizontal and vertical. warned (n,): whether a warning stands. raised: the warnings that
    were raised, "flow doubted", in the whole flight, or from t0 on where a sensor fails. since_s (n,): since t0;
    lasts_s: how long the fault lasts.
    """

    fault: str
    error_m: NDArray[np.float32]
    level_m: NDArray[np.float32]
    warned: NDArray[np.bool_]
    raised: frozenset[str]
    since_s: NDArray[np.float32] = np.zeros(0, np.float32)
    lasts_s: float = 0.0

    @property
    def above(self) -> NDArray[np.bool_]:
        """(n, 2): error above the level without a warning; a level that is no number protects from nothing."""
        found: NDArray[np.bool_] = ~(self.error_m <= self.level_m) & ~self.warned[:, None]
        return found


class When(NamedTuple):
    """When errors are above the level without a warning, for faults of one duration; pairs are horizontal and vertical.

    beyond: flights in which they ever are. unwarned: share of all steps. shares: of those steps, while the fault lasts,
    in the AFTERWARDS_S after it, and later.
    """

    fault: str
    lasts_s: float
    flights: int
    beyond: tuple[int, int]
    unwarned: tuple[float, float]
    shares: tuple[tuple[float, float], ...]


class Row(NamedTuple):
    """The result of all flights with one fault; pairs are horizontal and vertical.

    raised: share of flights in which each warning was raised. warned: share of steps at which any stands. unwarned:
    share of steps at which the error is above the level and none stands. beyond_m: by how much it is above, at most.
    ratio, level_m: medians over steps of level / error and of the level.
    """

    fault: str
    flights: int
    steps: int
    raised: dict[str, float]
    warned: float
    unwarned: tuple[float, float]
    beyond_m: tuple[float, float]
    ratio: tuple[float, float]
    level_m: tuple[float, float]


# -- flights -----------------------------------------------------------------------------------------------------
def judged(fault: str, flown: Navigated, truth: Table, t0_s: float, since_s: float, lasts_s: float = 0.0) -> Judged:
    """A run from t0 on, and the warnings that were raised from `since_s` on. ValueError where it states no levels."""
    if flown.levels_m is None:
        raise ValueError("a navigator without protection levels cannot be judged by them")
    course = course_of(flown, truth)
    after = course.t_s >= t0_s
    rows = np.searchsorted(flown.t_s, course.t_s[after])
    error = course.error_ned_m[after]
    return Judged(
        fault,
        np.column_stack([np.hypot(error[:, 0], error[:, 1]), np.abs(error[:, 2])]).astype(np.float32),
        flown.levels_m[rows].astype(np.float32),
        flagged(course.t_s[after], flown.flags),
        frozenset(f"{flag.source} {flag.kind}" for flag in flown.flags if flag.t0_s >= since_s),
        (course.t_s[after] - t0_s).astype(np.float32),
        lasts_s,
    )


def fly(
    navigate: Navigate,
    faulty_seeds: Iterable[int],
    clean_seeds: Iterable[int],
    faults: Sequence[Fault] = tuple(FAULTS.values()),
    heights_m: Sequence[float] = HEIGHTS_M,
    durations_s: Sequence[float] = DURATIONS_S,
) -> Iterator[Judged]:
    """Every seed at every height: without a fault for clean seeds, with each fault for faulty ones."""
    faulty, clean = set(faulty_seeds), set(clean_seeds)
    longest_s = longest(faults, durations_s)
    for seed in sorted(faulty | clean):
        for height_m in heights_m:
            log = flight_at(height_m, longest_s, seed)
            truth, hover_s = log.truth or {}, window_start(height_m)
            if seed in clean:
                yield judged(NO_FAULT, navigate(log.streams), truth, hover_s, -np.inf)
            for fault in faults if seed in faulty else ():
                t0_s = hover_s + longest_s + AFTER_S if fault.in_descent else hover_s
                for duration_s in durations_of(fault, durations_s):
                    streams = fault.inject(log.streams, t0_s, t0_s + duration_s, seed)
                    yield judged(fault.name, navigate(streams), truth, t0_s, t0_s, duration_s)


# -- what came of them -------------------------------------------------------------------------------------------
def row_of(name: str, flights: Sequence[Judged]) -> Row:
    """One row of the table, of all steps of some flights."""
    error = np.concatenate([flight.error_m for flight in flights])
    level = np.concatenate([flight.level_m for flight in flights])
    said = np.concatenate([flight.warned for flight in flights])
    above = np.concatenate([flight.above for flight in flights])
    warnings = Counter(warning for flight in flights for warning in flight.raised)
    beyond = np.where(above, error - level, 0.0).max(axis=0)
    ratio = np.median(level / np.maximum(error, 1e-6), axis=0)
    return Row(
        name,
        len(flights),
        len(said),
        {warning: count / len(flights) for warning, count in sorted(warnings.items())},
        float(said.mean()),
        *(_pair(values) for values in (above.mean(axis=0), beyond, ratio, np.median(level, axis=0))),
    )


def rows_of(flights: Iterable[Judged]) -> list[Row]:
    """A row a fault in the order flown, one of all faults together, and last the flights without a fault."""
    by_fault: dict[str, list[Judged]] = {}
    for flight in flights:
        by_fault.setdefault(flight.fault, []).append(flight)
    clean = by_fault.pop(NO_FAULT, [])
    rows = [row_of(name, found) for name, found in by_fault.items()]
    if by_fault:
        rows.append(row_of(TOGETHER, [flight for found in by_fault.values() for flight in found]))
    return rows + ([row_of(NO_FAULT, clean)] if clean else [])


def whens_of(flights: Iterable[Judged]) -> list[When]:
    """A row for each fault and duration, in the order flown, of those whose error is ever above the level without a
    warning.
    """
    grouped: dict[tuple[str, float], list[Judged]] = {}
    for flight in flights:
        grouped.setdefault((flight.fault, flight.lasts_s), []).append(flight)
    found = []
    for (fault, lasts_s), many in grouped.items():
        above = np.concatenate([flight.above for flight in many])
        after_s = np.concatenate([flight.since_s for flight in many]) - lasts_s
        steps = np.maximum(above.sum(axis=0), 1)
        spells = (after_s < 0.0, (after_s >= 0.0) & (after_s < AFTERWARDS_S), after_s >= AFTERWARDS_S)
        shares = tuple(_pair(above[spell].sum(axis=0) / steps) for spell in spells)
        north, down = (sum(bool(flight.above[:, axis].any()) for flight in many) for axis in range(2))
        if north or down:
            found.append(When(fault, lasts_s, len(many), (north, down), _pair(above.mean(axis=0)), shares))
    return found


def _pair(values: Array) -> tuple[float, float]:
    return float(values[0]), float(values[1])


# -- what it costs -----------------------------------------------------------------------------------------------
def cost(told: GivenSettings, streams: dict[Sensor, Stream], repeats: int = 15) -> float:
    """The navigator's time over a log with faults followed, divided by that without; medians of alternating runs."""
    spent_s: dict[bool, list[float]] = {True: [], False: []}
    clock: Callable[[], float] = time.perf_counter
    for k in range(2 * repeats):
        followed = k % 2 == 0
        _, queue, on = started(streams, told)
        if not followed:
            on.work[HYPOTHESES] = 0.0
        begun_s = clock()
        run(queue, on)
        spent_s[followed].append(clock() - begun_s)
    return float(np.median(spent_s[True]) / np.median(spent_s[False]))


# -- as a page ---------------------------------------------------------------------------------------------------
BEGIN, END = "<!-- make integrity: begin -->", "<!-- make integrity: end -->"
WHEN_BEGIN, WHEN_END = "<!-- make integrity, when: begin -->", "<!-- make integrity, when: end -->"
HEADINGS = (
    "fault", "flights", "suspected [% of flights]", "warning stands [% of steps]",
    "above the level without a warning, horizontal [‰ of steps]", "vertical [‰]", "at most above [m]", "vertical [m]",
    "level / error, median", "vertical", "level, median [m]", "vertical [m]",
)  # fmt: skip


def table(rows: Sequence[Row]) -> str:
    """The rows as a Markdown table."""
    lines = [HEADINGS, ("---", *["---:"] * (len(HEADINGS) - 1)), *map(_cells, rows)]
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)


def section(rows: Sequence[Row], long: Sequence[Row], seeds: tuple[int, int], cost: float) -> str:
    """The tables with how they were made.

    rows: of faults as `flownav faults` has them; long: of such that last. seeds: first and last of all flights. cost:
    the time of following faults, as a factor on the navigator's.
    """
    steps = sum(row.steps for row in rows if row.fault != TOGETHER)
    return (
        f"Printed by `make integrity` with flownav {__version__}, seeds {seeds[0]} to {seeds[1]}, {steps} steps. The "
        f"navigator took {cost:.2f} times as long as without following faults.\n\n{table(rows)}\n"
        + "".join(f"{alarms(row)}\n\n" for row in rows if row.fault == NO_FAULT)
        + f"The same with faults that last {LONG_S:g} s (`silence` 5 s):\n\n{table(long)}"
    )


WHEN_HEADINGS = (
    "fault", "lasts [s]", "flights", "ever above, horizontal", "vertical",
    "above without a warning, horizontal [‰ of steps]", "vertical [‰]",
    "of these while it lasts / 10 s after / later, horizontal [%]", "vertical [%]",
)  # fmt: skip


def when_table(rows: Sequence[When]) -> str:
    """The rows as a Markdown table."""
    lines = [WHEN_HEADINGS, ("---", *["---:"] * (len(WHEN_HEADINGS) - 1))]
    for row in rows:
        spells = [" / ".join(f"{100.0 * pair[axis]:.0f}" for pair in row.shares) for axis in range(2)]
        shown = [said if row.beyond[axis] else "-" for axis, said in enumerate(spells)]
        unwarned = [f"{1000.0 * share:.2f}" for share in row.unwarned]
        lines.append((f"`{row.fault}`", f"{row.lasts_s:g}", str(row.flights), *map(str, row.beyond), *unwarned, *shown))
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)


def alarms(row: Row) -> str:
    """The warnings of flights in which nothing failed."""
    counted = {SUSPECTS: 0.0, **row.raised}
    said = "; ".join(f"`{name}` in {round(share * row.flights)}" for name, share in counted.items())
    return f"Warnings in the {row.flights} flights in which nothing fails: {said}."


def placed(page: str, text: str, name: str, first: str = BEGIN, last: str = END) -> str:
    """A page with a text between its two marks. InputError where it lacks them."""
    before, begin, rest = page.partition(first)
    _, end, after = rest.partition(last)
    if not (begin and end):
        raise InputError(f"{name}: lacks the lines {first} and {last}; put them where the table belongs")
    return f"{before}{first}\n\n{text}\n{last}{after}"


def _cells(row: Row) -> tuple[str, ...]:
    percent = [f"{100.0 * share:.1f}" for share in (row.raised.get(SUSPECTS, 0.0), row.warned)]
    unwarned = [f"{1000.0 * share:.2f}" for share in row.unwarned]
    metres = [f"{value:.2f}" for value in (*row.beyond_m, *row.ratio, *row.level_m)]
    name = f"`{row.fault}`" if " " not in row.fault else f"**{row.fault}**"
    return (name, str(row.flights), *percent, *unwarned, *metres)


# -- as a program ----------------------------------------------------------------------------------------------------
TOLD_EVERY = 1000  # flights


def main(page: Path, seeds: int | None = None, faulty_seeds: int | None = None) -> None:
    """Fly, print and write; with `seeds` the last table, of this number of flights, and the others only where
    `faulty_seeds` gives their number, with four times as many without a fault. FlownavError where the page has no
    place.
    """
    text = page.read_text(encoding="utf-8")
    placed(placed(text, "", str(page)), "", str(page), WHEN_BEGIN, WHEN_END)
    fitted = assemble(load_scenario(BASE)).fitted
    assert fitted is not None
    navigate = navigator_with(fitted.given)
    few = range(FIRST_SEED, FIRST_SEED + (seeds or LONG_SEEDS))
    lasting = list(counted(fly(navigate, few, (), durations_s=(LONG_S,))))
    if seeds is None or faulty_seeds is not None:
        counts = (FAULTY_SEEDS, CLEAN_SEEDS) if faulty_seeds is None else (faulty_seeds, 4 * faulty_seeds)
        faulty, clean = (range(FIRST_SEED, FIRST_SEED + count) for count in counts)
        rows = rows_of(counted(fly(navigate, faulty, clean)))
        spent = cost(fitted.given, flight_at(1.5, 5.0, FIRST_SEED).streams)
        found = section(rows, rows_of(lasting), (clean[0], clean[-1]), spent)
        text = placed(text, found, str(page))
        print(found)
    shorter = counted(fly(navigate, few, (), durations_s=DURATIONS_S[-1:]))
    parts = (flight for s in (DURATIONS_S[-1], LONG_S) for flight in fly(navigate, few, (), PARTS, durations_s=(s,)))
    whens = whens_of([*shorter, *lasting, *counted(parts)])
    found = f"Printed by `make integrity`, seeds {few[0]} to {few[-1]}.\n\n{when_table(whens)}"
    print(found)
    with written_whole(page) as temporary:
        again = placed(text, found, str(page), WHEN_BEGIN, WHEN_END)
        temporary.write_text(again, encoding="utf-8", newline="\n")


def counted(flights: Iterable[Judged]) -> Iterator[Judged]:
    """Yield the same flights; their number is printed on the way."""
    for count, flight in enumerate(flights, 1):
        if count % TOLD_EVERY == 0:
            print(f"integrity: {count} flights", file=sys.stderr)
        yield flight


if __name__ == "__main__":
    told = sys.argv[1:]
    if len(told) not in (1, 2, 3) or not all(count.isdecimal() and int(count) > 0 for count in told[1:]):
        sys.exit("usage: python tools/integrity.py PAGE [SEEDS of the last tables [SEEDS of the first]]")
    try:
        main(Path(told[0]), *map(int, told[1:]))
    except (FlownavError, OSError) as error:
        sys.exit(f"flownav: {error}")
