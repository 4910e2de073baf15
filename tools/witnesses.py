"""Each witness lies in turn: every sensor of the whole mission, in every way and in every phase, and what it cost.

One flight of the scenario `sortie` a seed, with its own navigator; its recorded readings then go through the same
navigator again with one lie of LASTS_S in them. The flight is not changed by the lie, so that what moves is the
estimate alone (an autopilot that uses it is in `flownav faults`). The same readings give the same bits in flight, from
a log and on a link (tests/navigation, tests/live), so that one way in stands for all.

Printed into a page by `make witnesses`: python tools/witnesses.py PAGE [--seeds N]
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from flownav.campaigns.faults import inject
from flownav.campaigns.faults.inject import Injector, Strike, struck
from flownav.campaigns.faults.navigator import Navigated, navigator_of
from flownav.campaigns.faults.score import course_of, moved, recovered_after
from flownav.campaigns.faults.table import log_of, stood
from flownav.campaigns.local import fly_recorded
from flownav.core.files import written_whole
from flownav.core.measurement import Array, Sensor, Stream
from flownav.core.record import Table
from flownav.core.version import __version__
from flownav.scoring.course import first_contact
from flownav.simulation.assemble import assemble
from flownav.simulation.scenario import load_scenario
from integrity import judged, placed

SCENARIO, FIRST_SEED = "sortie", 501
LASTS_S, AFTER_S = 5.0, 5.0  # of a lie, and within which of its end the estimate is asked to be right again
LATE_S, IN_FIVES, NOISIER, SCALE = 0.3, 5, 10.0, 1.5
BEGIN, END = "<!-- make witnesses: begin -->", "<!-- make witnesses: end -->"


class Witness(NamedTuple):
    """A sensor, or those of its columns that lie together. bias: as large as such a sensor's offset may become.

    from_first: its zero is arbitrary, so that scale and sign are those of its change since the lie began.
    """

    name: str
    sensor: Sensor
    columns: slice
    bias: tuple[float, ...]
    from_first: bool = False

    def at(self, width: int) -> Array:
        """The offset in all columns of the stream (width,)."""
        every = np.zeros(width)
        every[self.columns] = self.bias
        return every


ALL = slice(None)
WITNESSES = (
    Witness("gyro", Sensor.IMU, slice(0, 3), (0.02, 0.02, 0.02)),
    Witness("accelerometer", Sensor.IMU, slice(3, 6), (0.5, 0.5, 0.5)),
    Witness("flow", Sensor.FLOW_RATE, slice(0, 2), (0.1, 0.1)),
    Witness("range", Sensor.RANGE, ALL, (0.5,)),
    Witness("GPS position", Sensor.GPS_POSITION, ALL, (5.0, 0.0, 5.0), from_first=True),
    Witness("GPS velocity", Sensor.GPS_VELOCITY, ALL, (1.0, 0.0, 0.5)),
    Witness("barometer", Sensor.BARO, ALL, (3.0,), from_first=True),
    Witness("magnetometer", Sensor.MAG, ALL, (0.0, 0.2, 0.0)),
    Witness("pad camera", Sensor.PAD, ALL, (0.2, 0.0, 0.0)),
    Witness("landed", Sensor.LANDED, ALL, (1.0,)),
)
NO_NUMBER = ("bias", "scale", "noise")  # of what says yes or no


# -- the lies: those of `campaigns.faults.inject`, and what that has not -------------------------------------------
Said = Callable[[Array, Strike], Array]


def told(what: Said) -> Injector:
    """The injector that replaces all values (n, k) of a stream; `lied` takes those of the lie's time and columns."""
    return lambda stream, strike: replace(stream, value=np.asarray(what(stream.value, strike)))


def offset(witness: Witness) -> Injector:
    """The witness's own offset."""
    return told(lambda value, _: value + witness.at(value.shape[1]))


def through(gain: float, witness: Witness) -> Injector:
    """So much times what is so: scale, or sign; of what says yes or no, the other."""
    if witness.sensor == Sensor.LANDED:
        return told(lambda value, _: 1.0 - value)

    def what(value: Array, strike: Strike) -> Array:
        zero = value[np.argmax(strike.inside)] if witness.from_first else 0.0
        return zero + gain * (value - zero)

    return told(what)


def in_fives(value: Array, strike: Strike) -> Array:
    """The first of every five, repeated five times."""
    since = np.arange(len(value)) - np.argmax(strike.inside)
    return np.asarray(value[np.maximum(np.arange(len(value)) - since % IN_FIVES, 0)])


def noisy(value: Array, strike: Strike) -> Array:
    """Noise NOISIER times its own, which its second differences show."""
    usual = np.sqrt(np.mean(np.diff(value, 2, axis=0) ** 2, axis=0) / 6.0)
    return np.asarray(value + NOISIER * usual * strike.rng.standard_normal(value.shape))


LIES: dict[str, Callable[[Witness], Injector]] = {
    "bias": offset,
    "scale": lambda witness: through(SCALE, witness),
    "sign": lambda witness: through(-1.0, witness),
    "stuck": lambda _: inject.stuck,
    "late": lambda _: inject.late(LATE_S),
    "repeated": lambda _: told(in_fives),
    "noise": lambda _: told(noisy),
    "silent": lambda _: inject.lost,
}


def lied(stream: Stream, witness: Witness, lie: str, begins_s: float, seed: int) -> Stream:
    """The stream with a lie of LASTS_S in what the witness says; itself where it says nothing then."""
    window_s, own = (begins_s, begins_s + LASTS_S), {stream.sensor: stream}
    found = struck(own, LIES[lie](witness), (stream.sensor,), window_s, f"{witness.name} {lie}", seed)[stream.sensor]
    if found is stream or len(found) < len(stream):
        return found
    inside = (stream.t_s >= window_s[0]) & (stream.t_s < window_s[1])
    mine = np.zeros(stream.value.shape[1], bool)
    mine[witness.columns] = True
    return replace(stream, value=np.where(inside[:, None] & mine, found.value, stream.value))


# -- the flight --------------------------------------------------------------------------------------------------
def phases(truth: Table) -> dict[str, float]:
    """When a lie begins in each phase [s], by where the vehicle is."""
    t_s, height_m = truth["t_s"], -(truth["pos_d_m"] - truth["pos_d_m"][0])
    ground = np.asarray(truth["on_ground"], float)
    lifted_s = float(t_s[np.argmax(ground == 0.0)])
    contact_s = float(t_s[first_contact(ground[:, None])[0]])
    top_s = float(t_s[np.argmax(height_m > 0.95 * height_m.max())])
    return {
        "standing": lifted_s - 0.5 - LASTS_S if lifted_s > LASTS_S + 3.0 else lifted_s - 3.0,
        "lift-off": lifted_s - 0.5,
        "climb": lifted_s + 1.0,
        "hover": top_s + 8.0,
        "flight": top_s + 24.0,
        "descent": contact_s - 8.0,
        "touchdown": contact_s - 1.0,
        "at rest": contact_s + 5.0,
    }


class Cost(NamedTuple):
    """The cost of a lie. moved_m: the estimate, at most, until AFTER_S after its end; back_s: None where never right.

    beyond_s: how long the error was beyond the protection level without a warning, which it was not without the lie.
    """

    seed: int
    witness: str
    lie: str
    phase: str
    moved_m: float
    back_s: float | None
    beyond_s: float


def costs(seed: int) -> Iterator[Cost]:
    """Every witness, lie and phase on one flight."""
    setup = assemble(load_scenario(SCENARIO))
    log = stood(log_of(fly_recorded(setup, seed), setup))
    navigate, truth = navigator_of(setup), log.truth or {}
    without = navigate(log.streams)
    usual_s = beyond(without, truth)
    for phase, begins_s in phases(truth).items():
        ends_s = begins_s + LASTS_S
        for witness in WITNESSES:
            stream = log.streams[witness.sensor]
            for lie in LIES:
                if witness.sensor == Sensor.LANDED and lie in NO_NUMBER:
                    continue
                false = lied(stream, witness, lie, begins_s, seed)
                if false is stream:
                    continue
                run = navigate({**log.streams, witness.sensor: false})
                away_m = moved(run, without, (begins_s, ends_s + AFTER_S))
                back_s = recovered_after(course_of(run, truth), course_of(without, truth), ends_s)
                yield Cost(seed, witness.name, lie, phase, np.inf if away_m is None else away_m, back_s,
                           max(0.0, beyond(run, truth) - usual_s))  # fmt: skip


def beyond(run: Navigated, truth: Table) -> float:
    """How long the error is beyond the level with no warning that stands [s], either level."""
    flight = judged(SCENARIO, run, truth, 0.0, -np.inf)
    steps_s = np.diff(flight.since_s, append=flight.since_s[-1])
    return float(steps_s[flight.above.any(axis=1)].sum())


# -- as a page ---------------------------------------------------------------------------------------------------
HEADINGS = ("witness", "lie", "moved, median [m]", "at most [m]", "in", "right again in 5 s [%]", "slowest [s]",
            "beyond the level without a warning [s], at most")  # fmt: skip


def table(found: Sequence[Cost]) -> str:
    """A row for each witness and lie, over phases and seeds."""
    lines = [HEADINGS, ("---", "---", "---:", "---:", "---", "---:", "---:", "---:")]
    for witness in WITNESSES:
        for lie in LIES:
            mine = [one for one in found if (one.witness, one.lie) == (witness.name, lie)]
            if not mine:
                continue
            worst = max(mine, key=lambda one: one.moved_m)
            back = [np.inf if one.back_s is None else one.back_s for one in mine]
            slowest = "never" if np.isinf(max(back)) else f"{max(back):.1f}"
            lines.append(
                (witness.name, lie, f"{np.median([one.moved_m for one in mine]):.2f}", f"{worst.moved_m:.2f}",
                 worst.phase, f"{100.0 * np.mean(np.array(back) <= AFTER_S):.0f}", slowest,
                 f"{max(one.beyond_s for one in mine):.1f}")
            )  # fmt: skip
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)


def section(found: Sequence[Cost], seeds: int) -> str:
    """The table, and what it comes to."""
    back = np.mean([one.back_s is not None and one.back_s <= AFTER_S for one in found])
    unwarned = sum(one.beyond_s > 0.0 for one in found)
    return (
        f"Printed by `make witnesses`, flownav {__version__}: {len(found)} lies of {LASTS_S:g} s in {seeds} flights "
        f"of `{SCENARIO}`, seeds from {FIRST_SEED}. Right again within {AFTER_S:g} s of the lie's end: "
        f"{100.0 * back:.1f} %. Beyond a protection level without a warning at any instant at which the flight without "
        f"the lie was not: {unwarned} of {len(found)}.\n\n{table(found)}"
    )


def main() -> None:
    """Print the table into a page, or onto the terminal."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("page", nargs="?", type=Path)
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--each", action="store_true", help="also print the lies that cost most, one by one")
    given = parser.parse_args()
    found = [cost for seed in range(FIRST_SEED, FIRST_SEED + given.seeds) for cost in costs(seed)]
    text = section(found, given.seeds)
    if given.each:
        for cost in sorted(found, key=lambda one: (-one.beyond_s, -one.moved_m))[:60]:
            print(cost)
    if given.page is None:
        print(text)
        return
    page = placed(given.page.read_text(encoding="utf-8"), text, str(given.page), BEGIN, END)
    with written_whole(given.page) as part:
        part.write_text(page, encoding="utf-8")


if __name__ == "__main__":
    main()
