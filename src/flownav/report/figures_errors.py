"""Errors of position and velocity in time, whole flights and close-ups: the paper's figures 19 to 21 and 23 to 30.

Where nobody knows the truth, what the estimate differs from GPS by.
"""

import numpy as np

from flownav.core.measurement import Array, Sensor
from flownav.core.record import POSITION_NED, VELOCITY_BODY, VELOCITY_NED, Record
from flownav.report import series
from flownav.report.chart import Stack, sliding_mean, sliding_rms
from flownav.report.figures_states import View, position, velocity
from flownav.report.panels import MINUS, Panel, listed, number
from flownav.report.series import Moment, Track, Window, has, moments, outages, readings, track

POSITION_ERRORS = ("x error (m)", "y error (m)", "z error (m)")
VELOCITY_ERRORS = ("u error (m/s)", "v error (m/s)", "w error (m/s)")
# what errors are taken of: states, titles of the axes, word, unit
ERRORS = ((POSITION_NED, POSITION_ERRORS, "position", "m"), (VELOCITY_BODY, VELOCITY_ERRORS, "velocity", "m/s"))
ROLE_WORDS = {"flown": "autopilot's input", "estimate": "estimate"}
CLOSE, CLOSE_ROOM = 0.9, 1.6  # of the errors after the first fix of the pad, and the room that they get
USUAL = 0.98  # of what is drawn of errors and bands is inside the axes
FRAME = "At the filter's own instant and in its own frame, which GPS has put somewhere."


def close_ups(record: Record) -> list[Panel]:
    """Position and velocity around lift-off and touchdown (figures 19 to 21 and 23 to 25) and in the worst outage."""
    panels = []
    start, end = series.start_end_s(record)
    for moment in moments(record):
        window = close_up_window(moment, start, end)
        name = moment.name.capitalize()
        errors = landing_errors(record, moment, window)
        panels += errors or [
            position(record, View(f"{moment.name}-position", f"{name}: position", window, with_gps=False)),
            velocity(record, View(f"{moment.name}-velocity", f"{name}: velocity", window)),
        ]
        if moment.name == "lift-off":
            panels.append(lift_off_transient(record, moment))
    outage = series.worst_outage(record)
    if outage is not None:
        window = (max(start, outage[0] - 5.0), min(end, outage[1] + 5.0))
        panels.append(position(record, View("outage-position", "GPS outage: position", window)))
        panels.append(velocity(record, View("outage-velocity", "GPS outage: velocity", window)))
    if not panels:
        why = "The record shows no lift-off, no touchdown and no GPS outage."
        panels.append(Panel("no-moments", "Take-off and landing", absent=why))
    return panels


def close_up_window(moment: Moment, start_s: float, end_s: float) -> Window:
    """15 s around a moment: mostly what follows a lift-off, mostly what precedes a touchdown."""
    before, after = (3.0, 12.0) if moment.name == "lift-off" else (12.0, 3.0)
    return (max(start_s, moment.t_s - before), min(end_s, moment.t_s + after))


def position_error(record: Record) -> Panel:
    """Position error with its 3-sigma band (figures 26 and 29)."""
    return _error(record, *ERRORS[0][:3])


def velocity_error(record: Record) -> Panel:
    """Velocity error with its 3-sigma band (figures 27 and 30)."""
    return _error(record, *ERRORS[1][:3])


def _error(record: Record, columns: tuple[str, ...], titles: tuple[str, ...], what: str) -> Panel:
    own = " in the filter's own frame" if what == "position" and has(record, "flown") else ""
    key, title = f"{what}-error", f"{what.capitalize()} error{own}"
    error, beyond = _error_of(record, "estimate", columns), False
    if error is None:
        missing = "truth" if track(record, "truth", columns) is None else "estimate"
        return Panel(key, title, absent=f"The record holds no {missing} of these states, so there is no error to draw.")
    stack = Stack(titles)
    deviation = track(record, "estimate", tuple(f"std_{name}" for name in columns))
    for row, values in enumerate(error.value.T, 1):
        band = np.zeros(1) if deviation is None else 3.0 * deviation.value[:, row - 1]
        if deviation is not None:
            stack.band(row, "±3\N{GREEK SMALL LETTER SIGMA} stated", deviation.t_s, band)
        reach = _reach(values, band)
        stack.within(row, reach)
        beyond = beyond or bool(np.abs(values).max(initial=0.0) > reach)
        stack.line(row, "estimate", f"estimate {MINUS} {series.truth_name(record)}", error.t_s, values)
    caption = (
        "A consistent filter stays inside its band about 99.7 % of the time."
        if deviation is not None
        else "The filter states no standard deviations, so there is no band."
    )
    caption += f" {FRAME}" if has(record, "flown") else ""
    caption += " The axes leave out rare peaks; zoom in on one to see it." if beyond else ""
    alt = f"{title} over time: {', '.join(titles)}. Drawn: {listed(stack.names)}."
    return Panel(key, title, caption, alt, stack.chart(series.start_end_s(record), moments(record)))


def _reach(values: Array, band: Array) -> float:
    """Half the height of an axis that shows error and band but for their first moments and rare peaks."""
    usual = [np.quantile(np.abs(part[np.isfinite(part)]), USUAL) for part in (values, band) if np.isfinite(part).any()]
    return 1.2 * max([*map(float, usual), 1e-6])


def from_first_fix(record: Record) -> list[Panel]:
    """Errors of the estimate used by the autopilot, from the first fix of the pad to just after the touchdown; none
    without a fix.

    Before the fix the vehicle takes its pad to be where GPS and the scenario put it, metres off; after it the errors
    are those of the landing, and have an axis of their own.
    """
    fix_s, touch = series.first_pad_fix_s(record), next((m for m in moments(record) if m.name == "touchdown"), None)
    start, end = series.start_end_s(record)
    window = (max(start, fix_s or 0.0), end if touch is None else min(end, touch.t_s + 3.0))
    error = _error_of(record, "flown", POSITION_NED, window)
    if fix_s is None or error is None or not len(error.t_s):
        return []
    stack = _drawn(record, "flown", POSITION_ERRORS, error)
    for row, values in enumerate(error.value.T, 1):
        stack.within(row, CLOSE_ROOM * float(np.quantile(np.abs(values), CLOSE)) + 1e-3)
    caption = (
        f"From the pad camera's first fix at {fix_s:.1f} s, each axis to its own scale. The axes hold "
        f"{100 * CLOSE:.0f} % of the errors with room; zoom in on a stretch to see all of it."
    )
    title = "Position error from the first pad fix on"
    alt = f"{title}: {', '.join(POSITION_ERRORS)}, from {window[0]:.0f} to {window[1]:.0f} s."
    return [Panel("pad-error", title, caption, alt, stack.chart(window, moments(record)), wide=True)]


def _error_of(record: Record, role: str, columns: tuple[str, ...], window: Window | None = None) -> Track | None:
    """A table's states less the truth, in a window; None where either lacks them."""
    source, truth = track(record, role, columns), track(record, "truth", columns)
    return None if source is None or truth is None else series.difference(source, truth).within(window)


def _drawn(record: Record, role: str, titles: tuple[str, ...], error: Track) -> Stack:
    """Each component of an error on an axis of its own."""
    stack = Stack(titles)
    for row, values in enumerate(error.value.T, 1):
        stack.line(row, role, f"{ROLE_WORDS[role]} {MINUS} {series.truth_name(record)}", error.t_s, values)
    return stack


def landing_errors(record: Record, moment: Moment, window: Window) -> list[Panel]:
    """Errors of position and velocity about a moment, of the estimate used by the autopilot or else of the navigator's;
    none without.
    """
    role = "flown" if has(record, "flown") else "estimate"
    panels = []
    for columns, titles, what, unit in ERRORS:
        error = _error_of(record, role, columns, window)
        if error is None:
            continue
        stack = _drawn(record, role, titles, error)
        at = error.value[np.argmin(np.abs(error.t_s - moment.t_s))] if len(error.t_s) else np.full(3, np.nan)
        caption = f"At {moment.name}: {', '.join(number(float(value), 3) for value in at)} {unit}."
        title = f"{moment.name.capitalize()}: {what} error"
        alt = f"{title} from {window[0]:.0f} to {window[1]:.0f} s: {', '.join(titles)}. {caption}"
        panels.append(Panel(f"{moment.name}-{what}-error", title, caption, alt, stack.chart(window, moments(record))))
    return panels


def flown_errors(record: Record) -> list[Panel]:
    """Errors of the estimate used by the autopilot at present, relative to the believed place of the pad; none
    without.
    """
    panels = []
    for columns, titles, what, _ in ERRORS:
        error = _error_of(record, "flown", columns)
        if error is None:
            return []
        figure = _drawn(record, "flown", titles, error).chart(series.start_end_s(record), moments(record))
        title = f"Autopilot's input: {what} error"
        caption = "Until the hand-over the vehicle stands, or the autopilot uses the truth: no error, by definition."
        panels.append(Panel(f"flown-{what}-error", title, caption, f"{title} over time: {', '.join(titles)}.", figure))
    return panels


def lift_off_transient(record: Record, lift_off: Moment) -> Panel:
    """Error in w around lift-off beside the rotor thrust that shakes the flow sensor (figure 28)."""
    key, title = "lift-off-transient", "Lift-off transient"
    window = (lift_off.t_s - 3.0, lift_off.t_s + 6.0)
    error, thrust = _error_of(record, "estimate", VELOCITY_BODY, window), track(record, "truth", ("thrust_n",))
    if error is None:
        return Panel(key, title, absent="Without truth the error at lift-off is not known.")
    stack = Stack(("w error (m/s)", "thrust (N)") if thrust else ("w error (m/s)",), row_height_px=190)
    stack.line(1, "estimate", f"estimate {MINUS} {series.truth_name(record)}", error.t_s, error.value[:, 2])
    if thrust:
        shown = thrust.within(window)
        stack.line(2, "truth", "rotor thrust", shown.t_s, shown.value[:, 0])
    papers = ", as in the paper's figure 28" if record.manifest.get("kind") == "fly" else ""
    caption = f"How the change of thrust at lift-off disturbs the estimate of w{papers}."
    alt = f"Error of w and rotor thrust around lift-off at {lift_off.t_s:.1f} s."
    return Panel(key, title, caption, alt, stack.chart(window, [lift_off]), wide=True)


WINDOW_S = 5.0


def residuals(record: Record) -> list[Panel]:
    """Estimate less GPS, position and velocity in the earth's axes; none where either is missing."""
    found = (
        _residual(record, POSITION_NED, Sensor.GPS_POSITION, "estimate", "position", "m"),
        _residual(record, VELOCITY_NED, Sensor.GPS_VELOCITY, "states", "velocity", "m/s"),
    )
    return [panel for panel in found if panel is not None]


def _residual(
    record: Record, columns: tuple[str, ...], sensor: Sensor, table: str, what: str, unit: str
) -> Panel | None:
    titles = tuple(f"{axis} ({unit})" for axis in ("north", "east", "down"))
    key, title = f"gps-{what}-residual", f"Estimate less GPS {what}"
    gps, estimate = readings(record, sensor), track(record, table, columns)
    if gps is None or estimate is None:
        return None
    stack = Stack(titles)
    own = track(record, "autopilot", columns)
    for role, name, source in (("autopilot", "autopilot", own), ("estimate", "estimate", estimate)):
        if source is None:
            continue
        apart = series.difference(gps, source)
        for row, values in enumerate(-apart.value.T, 1):
            if role == "estimate":
                stack.dots(row, role, "each reading", apart.t_s, values)
            stack.line(row, role, f"{name} {MINUS} GPS", apart.t_s, sliding_mean(apart.t_s, values, WINDOW_S))
    windows = outages(record)
    caption = (
        f"At the instants that GPS describes, {series.delay_s(record, sensor.name.lower()):.2f} s before it arrived. "
    )
    caption += (
        f"The lines are means over a sliding {WINDOW_S:.0f} s. GPS has errors of its own, which stay in the difference."
    )
    caption += " Shaded: GPS was withheld from the filter." if windows else ""
    alt = f"{title} over time: {', '.join(titles)}. Drawn: {listed(stack.names)}."
    return Panel(key, title, caption, alt, stack.chart(series.start_end_s(record), moments(record), windows))


def error_against_gps(record: Record) -> Panel:
    """Horizontal distance from GPS of the estimate, smoothed or the autopilot's too, outages shaded; without truth."""
    key, title = "gps-distance", "Horizontal distance from GPS"
    gps, estimate = readings(record, Sensor.GPS_POSITION), track(record, "estimate", POSITION_NED)
    if gps is None or estimate is None:
        return Panel(key, title, absent=f"The record holds no {'GPS position' if gps is None else 'estimate'}.")
    stack = Stack(("distance (m)",), row_height_px=250)
    others = [(role, track(record, role, POSITION_NED)) for role in ("autopilot", "smoothed")]
    for role, source in (*others, ("estimate", estimate)):
        if source is not None:
            apart = series.difference(gps, source)
            distance = np.hypot(*apart.value[:, :2].T)
            stack.dots(1, role, f"each reading, {role}", apart.t_s, distance)
            stack.line(1, role, role, apart.t_s, sliding_rms(apart.t_s, distance**2, WINDOW_S))
    stack.from_zero()
    windows = outages(record)
    figure = stack.chart(series.start_end_s(record), moments(record), windows)
    caption = (
        f"Against each GPS reading, {series.delay_s(record, 'gps_position'):.2f} s before it arrived (its delay). "
    )
    caption += f"The lines are root mean squares over a sliding {WINDOW_S:.0f} s; GPS noise stays in them."
    if windows:
        caption += " Shaded: GPS was withheld; the scores leave out the distance at the start, the figure does not."
    return Panel(key, title, caption, f"{title} over time. {caption}", figure, wide=True)
