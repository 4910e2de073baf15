"""Position, velocity and their errors in time: the paper's figures 17 to 30."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from flownav.measurement import Sensor
from flownav.record import POSITION_NED, VELOCITY_BODY, Record
from flownav.report.chart import Stack
from flownav.report.panels import Panel, listed
from flownav.report.series import (
    Array,
    Moment,
    Track,
    Window,
    difference,
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
    truth_name,
    worst_outage,
)

POSITION_TITLES = ("x, north (m)", "y, east (m)", "z, down (m)")
VELOCITY_TITLES = ("u, forward (m/s)", "v, right (m/s)", "w, down (m/s)")
POSITION_ERRORS = ("x error (m)", "y error (m)", "z error (m)")
VELOCITY_ERRORS = ("u error (m/s)", "v error (m/s)", "w error (m/s)")
USUAL = 0.98  # of what is drawn of errors and bands is inside the axes
FRAME = "At the filter's own instant and in its own frame, which GPS has put somewhere."
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
    note = DOWN if view.with_gps else "The legend switches the GPS readings on."
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


def close_ups(record: Record) -> list[Panel]:
    """Position and velocity around lift-off and touchdown (figures 19 to 21 and 23 to 25) and in the worst outage."""
    panels = []
    start, end = start_end_s(record)
    for moment in moments(record):
        window = close_up_window(moment, start, end)
        name = moment.name.capitalize()
        panels.append(position(record, View(f"{moment.name}-position", f"{name}: position", window, with_gps=False)))
        panels.append(velocity(record, View(f"{moment.name}-velocity", f"{name}: velocity", window)))
        if moment.name == "lift-off":
            panels.append(lift_off_transient(record, moment))
    outage = worst_outage(record)
    if outage is not None:
        window = (max(start, outage[0] - 5.0), min(end, outage[1] + 5.0))
        panels.append(position(record, View("outage-position", "GPS outage: position", window)))
        panels.append(velocity(record, View("outage-velocity", "GPS outage: velocity", window)))
    if not panels:
        why = "The record tells of no lift-off, no touchdown and no GPS outage."
        panels.append(Panel("no-moments", "Take-off and landing", absent=why))
    return panels


def close_up_window(moment: Moment, start_s: float, end_s: float) -> Window:
    """15 s around a moment: mostly what follows a lift-off, mostly what precedes a touchdown."""
    before, after = (3.0, 12.0) if moment.name == "lift-off" else (12.0, 3.0)
    return (max(start_s, moment.t_s - before), min(end_s, moment.t_s + after))


def position_error(record: Record) -> Panel:
    """Position error with its 3-sigma band (figures 26 and 29)."""
    return _error(record, POSITION_NED, POSITION_ERRORS, "position-error", "Position error")


def velocity_error(record: Record) -> Panel:
    """Velocity error with its 3-sigma band (figures 27 and 30)."""
    return _error(record, VELOCITY_BODY, VELOCITY_ERRORS, "velocity-error", "Velocity error")


def _error(record: Record, columns: tuple[str, ...], titles: tuple[str, ...], key: str, title: str) -> Panel:
    estimate, truth = track(record, "estimate", columns), track(record, "truth", columns)
    if estimate is None or truth is None:
        missing = "truth" if truth is None else "estimate"
        return Panel(key, title, absent=f"The record holds no {missing} of these states, so there is no error to draw.")
    stack = Stack(titles)
    deviation = track(record, "estimate", tuple(f"std_{name}" for name in columns))
    error, beyond = difference(estimate, truth), False
    for row, values in enumerate(error.value.T, 1):
        band = np.zeros(1) if deviation is None else 3.0 * deviation.value[:, row - 1]
        if deviation is not None:
            stack.band(row, "±3\N{GREEK SMALL LETTER SIGMA}, as the filter states it", deviation.t_s, band)
        reach = _reach(values, band)
        stack.within(row, reach)
        beyond = beyond or bool(np.abs(values).max(initial=0.0) > reach)
        stack.line(row, "estimate", f"estimate \N{MINUS SIGN} {truth_name(record)}", error.t_s, values)
    figure = stack.chart(start_end_s(record), moments(record))
    caption = (
        "A consistent filter stays inside its band about 99.7 % of the time."
        if deviation is not None
        else "The filter states no standard deviations, so there is no band."
    )
    caption += f" {FRAME}" if has(record, "flown") else ""
    caption += " The axes leave out rare peaks; zoom out to see them." if beyond else ""
    alt = f"{title} over time: {', '.join(titles)}. Drawn: {listed(stack.names)}."
    return Panel(key, title, caption, alt, figure)


def _reach(values: Array, band: Array) -> float:
    """Half the height of an axis that shows error and band but for their first moments and rare peaks."""
    usual = [np.quantile(np.abs(part[np.isfinite(part)]), USUAL) for part in (values, band) if np.isfinite(part).any()]
    return 1.2 * max([*map(float, usual), 1e-6])


def flown_errors(record: Record) -> list[Panel]:
    """Errors of what an autopilot flew on, the estimate of now from where the pad is taken to be; none without."""
    panels = []
    for columns, titles, what in (
        (POSITION_NED, POSITION_ERRORS, "position"),
        (VELOCITY_BODY, VELOCITY_ERRORS, "velocity"),
    ):
        flown, truth = track(record, "flown", columns), track(record, "truth", columns)
        if flown is None or truth is None:
            return []
        stack, error = Stack(titles), difference(flown, truth)
        for row, values in enumerate(error.value.T, 1):
            stack.line(row, "flown", f"flown on \N{MINUS SIGN} {truth_name(record)}", error.t_s, values)
        figure, title = stack.chart(start_end_s(record), moments(record)), f"What was flown on: {what} error"
        caption = "Until the hand-over the vehicle stands, or is flown on the truth: no error, by definition."
        panels.append(Panel(f"flown-{what}-error", title, caption, f"{title} over time: {', '.join(titles)}.", figure))
    return panels


def lift_off_transient(record: Record, lift_off: Moment) -> Panel:
    """Error in w around lift-off beside the rotor thrust that shakes the flow sensor (figure 28)."""
    key, title = "lift-off-transient", "Lift-off transient"
    estimate, truth = track(record, "estimate", VELOCITY_BODY), track(record, "truth", VELOCITY_BODY)
    if estimate is None or truth is None:
        return Panel(key, title, absent="Without truth the error at lift-off is not known.")
    window = (lift_off.t_s - 3.0, lift_off.t_s + 6.0)
    thrust = track(record, "truth", ("thrust_n",))
    stack = Stack(("w error (m/s)", "thrust (N)") if thrust else ("w error (m/s)",), row_height_px=190)
    error = difference(estimate, truth).within(window)
    stack.line(1, "estimate", f"estimate \N{MINUS SIGN} {truth_name(record)}", error.t_s, error.value[:, 2])
    if thrust:
        shown = thrust.within(window)
        stack.line(2, "truth", "rotor thrust", shown.t_s, shown.value[:, 0])
    figure = stack.chart(window, [lift_off])
    caption = "How the change of thrust at lift-off disturbs the estimate of w, as in the paper's figure 28."
    alt = f"Error of w and rotor thrust around lift-off at {lift_off.t_s:.1f} s."
    return Panel(key, title, caption, alt, figure, wide=True)
