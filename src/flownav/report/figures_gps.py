"""What the estimate differs from GPS by: the residuals of a flight whose truth nobody knows."""

from __future__ import annotations

import numpy as np

from flownav.core.measurement import Sensor
from flownav.core.record import POSITION_NED, VELOCITY_NED, Record
from flownav.report.chart import Stack
from flownav.report.panels import Panel, listed
from flownav.report.samples import sliding_mean, sliding_rms
from flownav.report.series import delay_s, difference, moments, outages, readings, start_end_s, track

WINDOW_S = 5.0


def residuals(record: Record) -> list[Panel]:
    """Estimate less GPS, position and velocity in the earth's axes; none where either is missing."""
    position = _residual(
        record, POSITION_NED, Sensor.GPS_POSITION, "estimate", ("north (m)", "east (m)", "down (m)"),
        "gps-position-residual", "Estimate less GPS position",
    )  # fmt: skip
    velocity = _residual(
        record, VELOCITY_NED, Sensor.GPS_VELOCITY, "states", ("north (m/s)", "east (m/s)", "down (m/s)"),
        "gps-velocity-residual", "Estimate less GPS velocity",
    )  # fmt: skip
    return [panel for panel in (position, velocity) if panel is not None]


def _residual(
    record: Record, columns: tuple[str, ...], sensor: Sensor, table: str, titles: tuple[str, ...], key: str, title: str
) -> Panel | None:
    gps, estimate = readings(record, sensor), track(record, table, columns)
    if gps is None or estimate is None:
        return None
    minus = "\N{MINUS SIGN}"
    stack = Stack(titles)
    own = track(record, "autopilot", columns)
    for role, name, source in (("autopilot", "autopilot", own), ("estimate", "estimate", estimate)):
        if source is None:
            continue
        apart = difference(gps, source)
        for row, values in enumerate(-apart.value.T, 1):
            if role == "estimate":
                stack.dots(row, role, "each reading", apart.t_s, values)
            stack.line(row, role, f"{name} {minus} GPS", apart.t_s, sliding_mean(apart.t_s, values, WINDOW_S))
    windows = outages(record)
    caption = f"At the instants that GPS describes, {delay_s(record, sensor.name.lower()):.2f} s before it arrived. "
    caption += (
        f"The lines are means over a sliding {WINDOW_S:.0f} s. GPS has errors of its own, which stay in the difference."
    )
    caption += " Shaded: GPS was withheld from the filter." if windows else ""
    alt = f"{title} over time: {', '.join(titles)}. Drawn: {listed(stack.names)}."
    return Panel(key, title, caption, alt, stack.chart(start_end_s(record), moments(record), windows))


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
            apart = difference(gps, source)
            distance = np.hypot(*apart.value[:, :2].T)
            stack.dots(1, role, f"each reading, {role}", apart.t_s, distance)
            stack.line(1, role, role, apart.t_s, sliding_rms(apart.t_s, distance**2, WINDOW_S))
    stack.from_zero()
    windows = outages(record)
    figure = stack.chart(start_end_s(record), moments(record), windows)
    caption = f"Against each GPS reading, {delay_s(record, 'gps_position'):.2f} s before it arrived (its delay). "
    caption += f"The lines are root mean squares over a sliding {WINDOW_S:.0f} s; GPS noise stays in them."
    if windows:
        caption += " Shaded: GPS was withheld; the scores leave out the distance at the start, the figure does not."
    return Panel(key, title, caption, f"{title} over time. {caption}", figure, wide=True)
