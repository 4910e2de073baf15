"""Position, velocity and their errors in time: the paper's figures 17 to 30."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from flownav.core.measurement import Sensor
from flownav.core.record import POSITION_NED, VELOCITY_BODY, Record
from flownav.report.chart import Stack
from flownav.report.panels import Panel, listed
from flownav.report.series import (
    Array,
    Track,
    Window,
    estimates,
    flow_readings,
    flow_velocity,
    gps_velocity_body,
    has,
    moments,
    outages,
    readings,
    start_end_s,
    track,
)

POSITION_TITLES = ("x, north (m)", "y, east (m)", "z, down (m)")
VELOCITY_TITLES = ("u, forward (m/s)", "v, right (m/s)", "w, down (m/s)")
REFERENCE = ("pos_n_ref_m", "pos_e_ref_m", "pos_d_ref_m")
PLACED = "What is flown on counts from where the vehicle takes its pad to be, the estimate from the filter's origin."
DOWN = "z is positive down (NED); its axis is drawn upside down, so that up on the page is up."


class View(NamedTuple):
    """A panel's key and title, the window of time [s] it shows (all where None), whether GPS is shown at once."""

    key: str
    title: str
    window: Window | None = None
    with_gps: bool = True


class Source(NamedTuple):
    """Something to draw: the role it is coloured by, its name in the legend, and its values."""

    role: str
    name: str
    track: Track | None


POSITION = View("position", "Position")
VELOCITY = View("velocity", "Velocity")


def position(record: Record, view: View = POSITION) -> Panel:
    """Position x, y, z: GPS readings, estimate, truth (figures 17 and 22)."""
    dots = [Source("gps", "GPS", readings(record, Sensor.GPS_POSITION))]
    lines = [Source("command", "reference", track(record, "command", REFERENCE))]
    lines += [Source(*source) for source in estimates(record, POSITION_NED)]
    note = DOWN if view.with_gps else ""
    note += f" {PLACED}" if has(record, "flown") and view.with_gps else ""
    return _states(record, POSITION_TITLES, dots, lines, view, note)


def velocity(record: Record, view: View = VELOCITY) -> Panel:
    """Body velocity u, v, w: flow, estimate, truth (figures 18 to 25)."""
    lines = [Source(*source) for source in estimates(record, VELOCITY_BODY)]
    flow = flow_velocity(record)
    name = "flow sensor" if has(record, "flow_velocity") else "flow \N{MULTIPLICATION SIGN} range"
    dots = [Source("flow", name, flow)]
    if not has(record, "truth", VELOCITY_BODY):
        dots.insert(0, Source("gps", "GPS velocity", gps_velocity_body(record)))
    note = "Body axes: forward, right, down."
    if flow is None:
        fused = flow_readings(record) is not None
        note += f" The record holds no {'range for its' if fused else 'valid'} flow readings."
    elif np.isnan(flow.value[:, 2]).all():
        note += " The flow sensor does not measure w."
    return _states(record, VELOCITY_TITLES, dots, lines, view, note)


def _states(
    record: Record, titles: tuple[str, ...], dots: list[Source], lines: list[Source], view: View, note: str
) -> Panel:
    if all(line.role == "command" for line in lines):
        return Panel(view.key, view.title, absent="The record holds no estimate and no truth of these states.")
    stack = Stack(titles)
    for role, name, source in dots:
        for row, t_s, values in _rows(source, view.window):
            stack.dots(row, role, name, t_s, values, shown=view.with_gps)
    for role, name, source in lines:
        for row, t_s, values in _rows(source, view.window):
            stack.line(row, role, name, t_s, values)
    if titles is POSITION_TITLES:
        stack.reverse(3)
    span = view.window or start_end_s(record)
    figure = stack.chart(span, moments(record), outages(record))
    alt = f"{view.title} from {span[0]:.0f} to {span[1]:.0f} s: {', '.join(titles)}. "
    return Panel(view.key, view.title, note, f"{alt}Drawn: {listed(stack.names)}.", figure)


def _rows(source: Track | None, window: Window | None) -> Iterator[tuple[int, Array, Array]]:
    """Each component of a track inside a window, as (row from 1, t_s, values)."""
    if source is not None:
        shown = source.within(window)
        for row, values in enumerate(shown.value.T, 1):
            yield row, shown.t_s, values
