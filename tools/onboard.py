"""The navigator's code size, memory and instructions on each processor, measured in emulators: python
tools/onboard.py PAGE.

Bytes of code, RAM, stack, instructions of each call by sensor, and digests, of the shipped flight pad_return and of the
same with inertial readings at 250 and 400 Hz. `make onboard` writes them as tables into a page, and as
`export/onboard/files/measured.json` for the output of `flownav build`.
"""

from __future__ import annotations

import json
import sys
import tempfile
import time
from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from emulation.means import means_apart
from emulation.narrow import KEPT, worst
from flownav.api.building import SHIPPED_FLIGHT, flight_of
from flownav.core.errors import FlownavError
from flownav.core.files import written_whole
from flownav.core.measurement import Sensor
from flownav.core.version import __version__
from flownav.export.onboard import package
from flownav.export.onboard.board import NOTHING, Board
from flownav.export.onboard.code import WITHOUT
from flownav.export.onboard.interface import OUTCOME_NUMBERS, Rates
from flownav.export.onboard.library_boards import library_board
from flownav.export.onboard.package import Asked, Flight, code_of, pace_of, packed_settings, rates_of, readings_of
from flownav.export.onboard.targets import TARGETS
from flownav.navigation import progress, waiting
from flownav.navigation.rings import Given
from integrity import placed

BEGIN, END = "<!-- make onboard: begin -->", "<!-- make onboard: end -->"
USUAL_HZ, IMU_HZ = 100.0, (100.0, 250.0, 400.0)
SUMMED = ((250.0, 2), (400.0, 4))  # rates of the IMU, and how many readings are passed as one
MEASURED = Path(package.__file__).parent / "files" / "measured.json"
DIGEST_EVERY = 500
HORIZON_S = Rates().horizon_s
NOW_EVERY = 50


class Cost(NamedTuple):
    """Instructions of calls: how many calls, mean and most."""

    calls: int
    mean: float
    most: int

    @classmethod
    def of(cls, instructions: Sequence[int]) -> Cost:
        """Of calls that were counted."""
        return cls(len(instructions), float(np.mean(instructions)), max(instructions))


class Run(NamedTuple):
    """A flight on an emulated processor: instructions of a call by sensor, of the whole in a second, stack, digest."""

    rates: Rates
    sensors: dict[str, Cost]
    per_second: float
    stack_bytes: int
    digest: str
    readings: int


# -- flights --------------------------------------------------------------------------------------------------
def with_imu(readings: Sequence[Given], imu_hz: float) -> list[Given]:
    """The same readings with inertial ones of another rate, linear between those that there are."""
    own = [given for given in readings if given.sensor == Sensor.IMU]
    times, values = np.array([given.t_s for given in own]), np.array([given.numbers for given in own])
    t_s = np.arange(times[0], times[-1], 1.0 / imu_hz)
    rows = np.column_stack([np.interp(t_s, times, column) for column in values.T])
    made = [Given(float(at), int(Sensor.IMU), row) for at, row in zip(t_s, rows, strict=True)]
    return sorted([*made, *(given for given in readings if given.sensor != Sensor.IMU)], key=lambda given: given.t_s)


# -- on a processor -------------------------------------------------------------------------------------------
def run(target: str, flight: Flight, imu_hz: float, readings: Sequence[Given], folder: Path) -> Run:
    """Feed a flight to a target's library and to the same code here. AssertionError where they differ."""
    rates = rates_of(flight.segment, HORIZON_S)._replace(imu_hz=imu_hz)
    settings, lag = packed_settings(flight, pace_of(flight.settings, rates.horizon_s))
    there = library_board(target, settings, rates.sizes, folder, lag=lag, native=False)
    here = Board(settings, rates.sizes, lag=lag)
    there.count()
    spent: dict[str, list[int]] = defaultdict(list)
    for count, given in enumerate((*readings, *[NOTHING] * 50), 1):
        before = there.instructions
        said = there.take(given)
        name = Sensor(given.sensor).name if given.sensor else "flownav_work"
        spent[name].append(there.instructions - before)
        assert said.head == here.take(given).head, (target, count)
        if count % NOW_EVERY == 0:
            before = there.instructions
            there.now(given.t_s)
            spent["flownav_now"].append(there.instructions - before)
        if count % DIGEST_EVERY == 0:
            assert there.digest() == here.digest(), (target, count)
    assert there.digest() == here.digest(), target
    calls = [each for name, found in spent.items() if name != "flownav_now" for each in found]
    lasts_s = readings[-1].t_s - readings[0].t_s
    costs = {name: Cost.of(found) for name, found in spent.items()}
    return Run(rates, costs, sum(calls) / lasts_s, there.stack_bytes, f"{there.digest():016x}", len(readings))


# -- as a page --------------------------------------------------------------------------------------------------
def tables(runs: dict[str, Run], others: dict[float, Run], flown_here: tuple[Flight, list[Given]]) -> str:
    """The tables of `docs/explanation/onboard.md`."""
    flown = next(iter(runs.values()))
    return (
        f"Printed by `make onboard` with flownav {__version__}: `pad_return`, {flown.readings} readings, IMU at "
        f"{USUAL_HZ:g} Hz and {flown.rates.others_hz:g} others a second at most, horizon {HORIZON_S:g} s. "
        f"Instructions are counted by unicorn (x86-64, AArch64, Cortex-M7) and by "
        f"wasmtime (its fuel); k is a thousand of them, mean / most of a call.\n\n"
        + table(("", *runs), sizes(runs) + costs(runs))
        + f"\nEvery digest is that of the same readings in Python: `{flown.digest}` at the end.\n\n"
        "A Cortex-M7 with faster inertial readings:\n\n"
        + table(
            ("IMU [Hz]", "RAM [B]", "million instructions a second", "IMU [k]", "any call, most [k]"), rates(others)
        )
        + "\nMeans of several inertial readings in their place: how far the state is from that with all of them, in "
        "standard deviations, median / worst of the flight:\n\n"
        + table(("IMU [Hz]", "readings in a mean", "position", "velocity", "attitude"), summed(*flown_here))
        + "\nWhat is left out with `--without`, on a Cortex-M7:\n\n"
        + table(("without", "code [B]", "constants [B]"), parts())
        + "\nRounded to 32 bits after each call, and computed in 64: what a navigator of 32-bit floats would lose at "
        "least, in standard deviations, worst of the flight:\n\n"
        + table(("in 32 bits", "position", "velocity", "attitude"), narrowed(*flown_here))
    )


def table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A Markdown table."""
    lines = [head, ("---", *["---:"] * (len(head) - 1)), *rows]
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)


def ram_bytes(rates: Rates) -> int:
    """One navigator's."""
    return 8 * (progress.BOARD_ROWS + waiting.rows_of(rates.sizes))


def sizes(runs: dict[str, Run]) -> list[tuple[str, ...]]:
    """Bytes by target."""
    codes = {target: code_of(Asked(target), False) for target in runs}
    return [
        ("code [B]", *(str(code.code_bytes) for code in codes.values())),
        ("constants [B]", *(str(code.constant_bytes or "within") for code in codes.values())),
        ("RAM of a navigator [B]", *(str(ram_bytes(run.rates)) for run in runs.values())),
        ("an outcome, on the stack or elsewhere [B]", *(str(8 * OUTCOME_NUMBERS) for _ in runs)),
        ("stack at most [B]", *(str(run.stack_bytes) for run in runs.values())),
        ("million instructions a second", *(f"{run.per_second / 1e6:.1f}" for run in runs.values())),
    ]


def costs(runs: dict[str, Run]) -> list[tuple[str, ...]]:
    """Instructions by sensor and target."""
    names = next(iter(runs.values())).sensors
    return [
        (name, *(f"{run.sensors[name].mean / 1e3:.0f} / {run.sensors[name].most / 1e3:.0f} k" for run in runs.values()))
        for name in names
    ]


def rates(others: dict[float, Run]) -> list[tuple[str, ...]]:
    """By rate of the IMU."""
    return [
        (
            f"{hz:g}", str(ram_bytes(found.rates)), f"{found.per_second / 1e6:.1f}",
            f"{found.sensors['IMU'].mean / 1e3:.0f} / {found.sensors['IMU'].most / 1e3:.0f}",
            f"{max(cost.most for cost in found.sensors.values()) / 1e3:.0f}",
        )
        for hz, found in others.items()
    ]  # fmt: skip


def summed(flight: Flight, readings: Sequence[Given]) -> list[tuple[str, ...]]:
    """The cost of means of inertial readings, by rate and number of readings in one."""
    settings, lag = packed_settings(flight, pace_of(flight.settings, HORIZON_S))
    rows = []
    for hz, count in SUMMED:
        rates = rates_of(flight.segment, HORIZON_S)._replace(imu_hz=hz)
        median, most = means_apart(settings, rates, lag, with_imu(readings, hz), count)
        rows.append((f"{hz:g}", f"{count}", *(f"{a:.2g} / {b:.2g}" for a, b in zip(median, most, strict=True))))
    return rows


def parts() -> list[tuple[str, ...]]:
    """Code without parts."""
    found = []
    for without in ((), *((part,) for part in WITHOUT), tuple(WITHOUT)):
        code = code_of(Asked("cortex-m7", without=without), False)
        found.append((", ".join(without) or "-", str(code.code_bytes), str(code.constant_bytes)))
    return found


def narrowed(flight: Flight, readings: Sequence[Given]) -> list[tuple[str, ...]]:
    """The loss by 32 bits."""
    rates = rates_of(flight.segment, HORIZON_S)
    settings, lag = packed_settings(flight, pace_of(flight.settings, rates.horizon_s))
    names = list(KEPT)
    return [
        (" and ".join(kept), *(f"{each:.2g}" for each in worst(settings, rates, lag, readings, kept)))
        for kept in (names[:1], names[1:], names)
    ]


def told(runs: dict[str, Run]) -> dict[str, Any]:
    """The facts that `flownav build` reports of a target."""
    return {
        target: {
            "flight": SHIPPED_FLIGHT,
            "rates": f"IMU {USUAL_HZ:g} Hz",
            "code_bytes": code_of(Asked(target), False).code_bytes,
            "stack_bytes": run.stack_bytes,
            "per_second": round(run.per_second),
            "sensors": {
                name: {"mean": round(cost.mean), "most": cost.most} for name, cost in run.sensors.items()
            },
        }
        for target, run in runs.items()
    }  # fmt: skip


def main(page: Path) -> None:
    """Measure, print and write. FlownavError where the page has no place for the tables."""
    text = page.read_text(encoding="utf-8")
    placed(text, "", str(page), BEGIN, END)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        usual = flight_of(None)
        readings = readings_of(usual)
        runs = {}
        for target in TARGETS:
            began = time.monotonic()
            runs[target] = run(target, usual, USUAL_HZ, readings, folder)
            print(f"onboard: {target} in {time.monotonic() - began:.0f} s", file=sys.stderr, flush=True)
        others = {USUAL_HZ: runs["cortex-m7"]}
        for hz in IMU_HZ[1:]:
            others[hz] = run("cortex-m7", usual, hz, with_imu(readings, hz), folder)
            print(f"onboard: {hz:g} Hz", file=sys.stderr, flush=True)
    found = tables(runs, others, (usual, readings))
    with written_whole(MEASURED) as temporary:
        temporary.write_text(json.dumps(told(runs), indent=1) + "\n", encoding="utf-8")
    with written_whole(page) as temporary:
        temporary.write_text(placed(text, found, str(page), BEGIN, END), encoding="utf-8", newline="\n")
    print(found)


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit("usage: python tools/onboard.py PAGE")
    try:
        main(Path(sys.argv[1]))
    except (FlownavError, OSError) as error:
        sys.exit(f"flownav: {error}")
