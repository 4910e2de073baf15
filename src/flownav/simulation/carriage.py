"""Each carried sensor on lanes, made from its row: how it is drawn, how it starts, how it is read into a slot."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple, get_type_hints

from flownav.core.compile import Lanes, Layout, OnLanes, Work, equation, write_function
from flownav.simulation.carried import CarriedSensor
from flownav.simulation.layout import AS_IS, BEGUN, CARRIERS, NORMALS, STATE, UNIT, put_slot
from flownav.simulation.onboard import Fitting, Place
from flownav.simulation.records import Late
from flownav.simulation.truth import CARRIED, LATE


class Carriage(NamedTuple):
    """A sensor's loops over lanes; start and heard are None where it has none."""

    sensor: CarriedSensor
    draw: OnLanes
    start: OnLanes | None
    read: OnLanes
    heard: OnLanes | None


@equation
def punctual(work: Work, lanes: Lanes, lane: int) -> Late:
    """Not late at all: before the first epoch nothing is under way."""
    return Late(0.0)


def carriage_of(sensor: CarriedSensor) -> Carriage:
    """The loops of one sensor. TypeError where a law of its row takes what is no record."""
    own, before = records_of(sensor, starting=False), records_of(sensor, starting=True)
    start = before.on_lanes(sensor.start) if sensor.start else None
    heard = own.on_lanes(sensor.heard) if sensor.heard else None
    return Carriage(sensor, before.on_lanes(sensor.draw), start, own.on_lanes(sensor.step), heard)


def records_of(sensor: CarriedSensor, *, starting: bool) -> Layout:
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
    own.derive(Fitting, _carried_as(sensor.name, ""), "s")
    own.derive(Place, _carried_as(sensor.name, ".place"), "s")
    for law in sensor.see:
        own.see(law)
    if sensor.says[0].say is not None:
        own.sink(get_type_hints(sensor.says[0].say)["read"], *_teller(sensor))
    return own


def _carried_as(name: str, part: str) -> Callable[..., Any]:
    """`found(work, lanes, s, lane)`: how the sensor is carried, or a part of that."""
    source = f"def found(work, lanes, s, lane):\n    return s.carried.{name}{part}\n"
    return equation(write_function("found", source, {}))


def _teller(sensor: CarriedSensor) -> tuple[Any, ...]:
    """`tell(work, lanes, lane, read, *needs)` and its needs: each reading that the vehicle has of this into a slot."""
    scope: dict[str, Any] = {"put_slot": put_slot}
    needs = ("slot", "slots", "s") if len(sensor.says) > 1 else ("slot",)
    lines = [f"def tell(work, lanes, lane, read, {', '.join(needs)}):"]
    for k, said in enumerate(sensor.says):
        scope[f"say{k}"] = said.say
        place, told = f"(slot + {k}) % slots" if k else "slot", f"say{k}(read)"
        if k:
            lines.append(f"    if s.carried.{sensor.name}.clock.fitted > {k}:")
        lines.append(f"    {'    ' * (k > 0)}put_slot(work, lanes, {place}, lane, {told})")
    return equation(write_function("tell", "\n".join(lines) + "\n", scope)), *needs


CARRIAGES = {sensor.name: carriage_of(sensor) for sensor in CARRIED}
