"""The sensors' readings on lanes, by their own clocks, put into the ring in the order of `schedule`."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from typing import Any

from flownav.core.compile import OnLanes, equation, procedure, write_function
from flownav.simulation.carriage import CARRIAGES, Carriage
from flownav.simulation.draws import draw
from flownav.simulation.failing import Taken, strike
from flownav.simulation.layout import NORMALS, in_pairs
from flownav.simulation.onboard import EPOCH_S, Clock

INERTIAL_FAULT = CARRIAGES["inertial"].sensor.channels.fault  # of the first reading of an epoch


@equation
def due(clock: Clock, epoch: int) -> bool:
    """Whether a sensor reads in this epoch."""
    return clock.fitted > 0 and epoch >= clock.first and (epoch - clock.first) % clock.every == 0


@equation
def taken_now(epoch: int, slot: int, sensor: int, channel: int, clock: Clock) -> Taken:
    """A reading that a sensor has just put into a slot; channel: of what its fault would draw."""
    return Taken(epoch, epoch * EPOCH_S, slot, sensor, channel, epoch // clock.every)


def called(run: OnLanes) -> str:
    """The arguments of a loop over lanes, each by its own name."""
    return ", ".join(inspect.signature(run).parameters)


def drawn(one: Carriage, channel: str) -> str:
    """The line that draws the normals of a reading."""
    row, count = NORMALS[one.sensor.name], in_pairs(one.sensor.normals)
    return f"draw(work, lanes, {row}, {count}, seed, flight, epoch, {channel})"


def turn(number: int, one: Carriage, scope: dict[str, Any]) -> list[str]:
    """The lines of one sensor's turn in an epoch."""
    sensor, read, heard = one.sensor, f"read_{number}", f"heard_{number}"
    scope |= {read: one.read, heard: one.heard}
    lines = [
        f"clock = s.carried.{sensor.name}.clock",
        "if due(clock, epoch):",
        "    slot = taken % slots",
        f"    {drawn(one, str(sensor.channels.reading))}",
        f"    {read}({called(one.read)})",
        "    if fails is not None:",
    ]
    for k, said in enumerate(sensor.says):
        place, channel = f"(taken + {k}) % slots" if k else "slot", sensor.channels.fault + 3 * k
        reading = f"taken_now(epoch, {place}, {int(said.kind)}, {channel}, clock)"
        strikes = f"strike(work, lanes, seed, flight, {reading})"
        lines += [f"        if clock.fitted > {k}:", f"            {strikes}"] if k else [f"        {strikes}"]
    lines += [f"    {heard}({called(one.heard)})"] if one.heard else []
    return [*lines, "    taken += clock.fitted"]


def _sample() -> Callable[..., Any]:
    scope: dict[str, Any] = {"due": due, "draw": draw, "strike": strike, "taken_now": taken_now}
    lines = ["def sample(work, lanes, seed, flight, epoch, slots, taken, s, fails):"]
    for number, one in enumerate(CARRIAGES.values()):
        if one.sensor.on_epochs:
            lines += [f"    {line}" for line in turn(number, one, scope)]
    return procedure(write_function("sample", "\n".join([*lines, "    return taken"]) + "\n", scope))


def _read_inertial() -> Callable[..., Any]:
    one = CARRIAGES["inertial"]
    scope: dict[str, Any] = {"draw": draw, "read": one.read}
    lines = [
        "def read_inertial(work, lanes, seed, flight, epoch, part, slot, s):",
        f"    {drawn(one, f'{one.sensor.channels.reading} + {in_pairs(one.sensor.normals) // 2} * part')}",
        f"    read({called(one.read)})",
    ]
    return procedure(write_function("read_inertial", "\n".join(lines) + "\n", scope))


# sample(work, lanes, seed, flight, epoch, slots, taken, s, fails): every sensor whose clock says so, but the inertial
# one, in the order of the table; how many slots were taken. read_inertial: the inertial reading of the period that ends
# now, the `part`-th of the epoch, into a slot.
sample = _sample()
read_inertial = _read_inertial()
