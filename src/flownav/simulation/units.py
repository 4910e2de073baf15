"""Before a flight: every sensor as it is on this flight, and its state at rest or from its stationary distribution."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from flownav.core.compile import procedure, write_function
from flownav.simulation.carriage import CARRIAGES
from flownav.simulation.draws import draw
from flownav.simulation.layout import BEGUN, UNIT, in_pairs
from flownav.simulation.sampling import called


def _draw_units() -> Callable[..., Any]:
    lines = ["def draw_units(work, lanes, seed, flight, step):"]
    for sensor in (one.sensor for one in CARRIAGES.values()):
        for record, row, when in ((sensor.unit, UNIT, "step"), (sensor.begun, BEGUN, "step + 1")):
            if record is not None:
                drawn = f"{row[sensor.name]}, {in_pairs(record)}, seed, flight, {when}, {sensor.channels.start}"
                lines.append(f"    draw(work, lanes, {drawn})")
    return procedure(write_function("draw_units", "\n".join(lines) + "\n", {"draw": draw}))


def _start_onboard() -> Callable[..., Any]:
    lines, scope = ["def start_onboard(work, lanes, s):"], dict[str, Any]()
    for number, one in enumerate(CARRIAGES.values()):
        for run, name in ((one.draw, f"draw_{number}"), (one.start, f"start_{number}")):
            if run is not None:
                scope[name] = run
                lines.append(f"    {name}({called(run)})")
    return procedure(write_function("start_onboard", "\n".join(lines) + "\n", scope))


# draw_units(work, lanes, seed, flight, step): the normals of every unit and of its state, into their rows;
# start_onboard(work, lanes, s): the units and the states that these make
draw_units = _draw_units()
start_onboard = _start_onboard()
