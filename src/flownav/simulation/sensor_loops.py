"""Each carried sensor on lanes, made from its row: how it is drawn, how it starts, how it is read into a slot."""

import inspect
from collections.abc import Callable
from typing import Any, NamedTuple, get_type_hints

from flownav.core.compile import Lanes, Layout, OnLanes, Work, equation, procedure, write_function
from flownav.simulation.block import draw
from flownav.simulation.fault_injection import Taken, strike
from flownav.simulation.layout import AS_IS, BEGUN, CARRIERS, NORMALS, STATE, UNIT, in_pairs, put_slot
from flownav.simulation.onboard import EPOCH_S, Clock, Fitting, Place
from flownav.simulation.records import Late
from flownav.simulation.sensor_table import SensorRow
from flownav.simulation.truth import LATE, SENSOR_TABLE


class SensorLoops(NamedTuple):
    """A sensor's loops over lanes; start and after_reading are None where it has none."""

    sensor: SensorRow
    draw: OnLanes[..., Any]
    start: OnLanes[..., Any] | None
    read: OnLanes[..., Any]
    after_reading: OnLanes[..., Any] | None


@equation
def punctual(work: Work, lanes: Lanes, lane: int) -> Late:
    """Not late at all: before the first epoch nothing is under way."""
    return Late(0.0)


def loops_of(sensor: SensorRow) -> SensorLoops:
    """The loops of one sensor. TypeError where a law of its row takes what is no record."""
    own, before = records_of(sensor, starting=False), records_of(sensor, starting=True)
    start = before.loop(sensor.start) if sensor.start else None
    after_reading = own.loop(sensor.after_reading) if sensor.after_reading else None
    return SensorLoops(sensor, before.loop(sensor.draw), start, own.loop(sensor.step), after_reading)


def records_of(sensor: SensorRow, *, starting: bool) -> Layout:
    """The plant's records and the sensor's own. Before it is drawn, the rows of its unit hold the normals of it."""
    own = Layout(below=CARRIERS)
    named = [(sensor.parameters, AS_IS), (sensor.unit, UNIT), (sensor.state, STATE)]
    named.append((sensor.begun, BEGUN) if starting else (sensor.normals, NORMALS))
    for record, rows in named:
        if record is not None:
            own.name(record, *range(rows[sensor.name], rows[sensor.name] + len(record._fields)))
    if starting:
        own.derive(Late, punctual)
    elif sensor.late:
        own.name(Late, AS_IS["late"] + LATE.index(sensor.name))
    own.derive(Fitting, _fitting_as(sensor.name, ""), "s")
    own.derive(Place, _fitting_as(sensor.name, ".place"), "s")
    for law in sensor.see:
        own.see(law)
    if sensor.says[0].say is not None:
        own.sink(get_type_hints(sensor.says[0].say)["read"], *_writer(sensor))
    return own


def _fitting_as(name: str, part: str) -> Callable[..., Any]:
    """`found(work, lanes, s, lane)`: how the sensor is carried, or a part of that."""
    source = f"def found(work, lanes, s, lane):\n    return s.carried.{name}{part}\n"
    return equation(write_function("found", source, {}))


def _writer(sensor: SensorRow) -> tuple[Any, ...]:
    """`tell(work, lanes, lane, read, *needs)` and its needs: each reading that the vehicle has of this into a slot."""
    scope: dict[str, Any] = {"put_slot": put_slot}
    needs = ("slot", "slots", "s") if len(sensor.says) > 1 else ("slot",)
    lines = [f"def tell(work, lanes, lane, read, {', '.join(needs)}):"]
    for k, output in enumerate(sensor.says):
        scope[f"say{k}"] = output.say
        place, call = f"(slot + {k}) % slots" if k else "slot", f"say{k}(read)"
        if k:
            lines.append(f"    if s.carried.{sensor.name}.clock.fitted > {k}:")
        lines.append(f"    {'    ' * (k > 0)}put_slot(work, lanes, {place}, lane, {call})")
    return equation(write_function("tell", "\n".join(lines) + "\n", scope)), *needs


SENSOR_LOOPS = {sensor.name: loops_of(sensor) for sensor in SENSOR_TABLE}


INERTIAL_FAULT = SENSOR_LOOPS["inertial"].sensor.channels.fault  # of the first reading of an epoch


@equation
def due(clock: Clock, epoch: int) -> bool:
    """Whether a sensor reads in this epoch."""
    return clock.fitted > 0 and epoch >= clock.first and (epoch - clock.first) % clock.every == 0


@equation
def taken_now(epoch: int, slot: int, sensor: int, channel: int, clock: Clock) -> Taken:
    """A reading that a sensor has just put into a slot; channel: of what its fault would draw."""
    return Taken(epoch, epoch * EPOCH_S, slot, sensor, channel, epoch // clock.every)


def called(run: OnLanes[..., Any]) -> str:
    """The arguments of a loop over lanes, each by its own name."""
    return ", ".join(inspect.signature(run).parameters)


def drawn(one: SensorLoops, channel: str) -> str:
    """The line that draws the normals of a reading."""
    row, count = NORMALS[one.sensor.name], in_pairs(one.sensor.normals)
    return f"draw(work, lanes, {row}, {count}, seed, flight, epoch, {channel})"


def turn(number: int, one: SensorLoops, scope: dict[str, Any]) -> list[str]:
    """The lines of one sensor's turn in an epoch."""
    sensor, read, after_reading = one.sensor, f"read_{number}", f"after_{number}"
    scope |= {read: one.read, after_reading: one.after_reading}
    lines = [
        f"clock = s.carried.{sensor.name}.clock",
        "if due(clock, epoch):",
        "    slot = taken % slots",
        f"    {drawn(one, str(sensor.channels.reading))}",
        f"    {read}({called(one.read)})",
        "    if fails is not None:",
    ]
    for k, output in enumerate(sensor.says):
        place, channel = f"(taken + {k}) % slots" if k else "slot", sensor.channels.fault + 3 * k
        reading = f"taken_now(epoch, {place}, {int(output.kind)}, {channel}, clock)"
        strikes = f"strike(work, lanes, seed, flight, {reading})"
        lines += [f"        if clock.fitted > {k}:", f"            {strikes}"] if k else [f"        {strikes}"]
    lines += [f"    {after_reading}({called(one.after_reading)})"] if one.after_reading else []
    return [*lines, "    taken += clock.fitted"]


def _sample() -> Callable[..., Any]:
    scope: dict[str, Any] = {"due": due, "draw": draw, "strike": strike, "taken_now": taken_now}
    lines = ["def sample(work, lanes, seed, flight, epoch, slots, taken, s, fails):"]
    for number, one in enumerate(SENSOR_LOOPS.values()):
        if one.sensor.on_epochs:
            lines += [f"    {line}" for line in turn(number, one, scope)]
    return procedure(write_function("sample", "\n".join([*lines, "    return taken"]) + "\n", scope))


def _read_inertial() -> Callable[..., Any]:
    one = SENSOR_LOOPS["inertial"]
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


def _draw_units() -> Callable[..., Any]:
    lines = ["def draw_units(work, lanes, seed, flight, step):"]
    for sensor in (one.sensor for one in SENSOR_LOOPS.values()):
        for record, row, when in ((sensor.unit, UNIT, "step"), (sensor.begun, BEGUN, "step + 1")):
            if record is not None:
                drawn = f"{row[sensor.name]}, {in_pairs(record)}, seed, flight, {when}, {sensor.channels.start}"
                lines.append(f"    draw(work, lanes, {drawn})")
    return procedure(write_function("draw_units", "\n".join(lines) + "\n", {"draw": draw}))


def _start_onboard() -> Callable[..., Any]:
    lines, scope = ["def start_onboard(work, lanes, s):"], dict[str, Any]()
    for number, one in enumerate(SENSOR_LOOPS.values()):
        for run, name in ((one.draw, f"draw_{number}"), (one.start, f"start_{number}")):
            if run is not None:
                scope[name] = run
                lines.append(f"    {name}({called(run)})")
    return procedure(write_function("start_onboard", "\n".join(lines) + "\n", scope))


# draw_units(work, lanes, seed, flight, step): the normals of every unit and of its state, into their rows;
# start_onboard(work, lanes, s): the units and the states that these make
draw_units = _draw_units()
start_onboard = _start_onboard()
