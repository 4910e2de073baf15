"""The filter's states beyond position and velocity, each in the envelope that it states: biases, errors of sensors."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flownav.core.record import Record
from flownav.report.chart import Stack
from flownav.report.panels import Panel
from flownav.report.series import moments, outages, start_end_s, track

LEAST_CHANGE = 1e-9  # a state and a deviation that change by less were not estimated


class Group(NamedTuple):
    """A panel of states: its key, title and caption, and for each row a title and (state, name, role) drawn on it."""

    key: str
    title: str
    caption: str
    rows: tuple[tuple[str, float, tuple[tuple[str, str, str], ...]], ...]


DEGREES = 57.29577951308232
GROUPS = (
    Group(
        "gyro-bias",
        "Gyro bias",
        "What the filter takes the gyro's bias to be, and three of its standard deviations.",
        tuple((f"{a} (°/s)", DEGREES, ((f"gyro_bias_{a}_rad_s", "bias", "estimate"),)) for a in "xyz"),
    ),
    Group(
        "accel-bias",
        "Accelerometer bias",
        "The same of the accelerometer.",
        tuple((f"{a} (m/s²)", 1.0, ((f"accel_bias_{a}_m_s2", "bias", "estimate"),)) for a in "xyz"),
    ),
    Group(
        "gps-errors",
        "Error of the GPS position",
        "What the filter takes the receiver's error to be: a part that wanders for minutes and one for seconds.",
        tuple(
            (
                f"{title} (m)",
                1.0,
                ((f"gps_slow_{a}_m", "slow part", "estimate"), (f"gps_fast_{a}_m", "fast part", "gps")),
            )
            for title, a in (("north", "n"), ("east", "e"), ("down", "d"))
        ),
    ),
    Group(
        "gps-velocity-errors",
        "Error of the GPS velocity",
        "What the filter takes the receiver's velocity to be off by.",
        tuple(
            (f"{title} (m/s)", 1.0, ((f"gps_velocity_{a}_m_s", "error", "estimate"),))
            for title, a in (("north", "n"), ("east", "e"), ("down", "d"))
        ),
    ),
    Group(
        "other-states",
        "Other states of the filter",
        "Those that this flight's sensors let it estimate, each with three of its standard deviations.",
        (
            ("ground, down (m)", 1.0, (("ground_d_m", "ground", "estimate"),)),
            ("barometer (m)", 1.0, (("baro_m", "offset", "estimate"),)),
            ("flow scale (m/m)", 1.0, (("flow_scale", "error of scale", "estimate"),)),
            ("compass, sine (°)", DEGREES, (("compass_sin_rad", "error", "estimate"),)),
            ("compass, cosine (°)", DEGREES, (("compass_cos_rad", "error", "estimate"),)),
            ("attitude sensor, roll (°)", DEGREES, (("ins_roll_rad", "error", "estimate"),)),
            ("attitude sensor, pitch (°)", DEGREES, (("ins_pitch_rad", "error", "estimate"),)),
            ("attitude sensor, heading (°)", DEGREES, (("ins_heading_rad", "error", "estimate"),)),
            ("age of velocity (s)", 1.0, (("velocity_lag_s", "age", "estimate"),)),
            ("pad, north (m)", 1.0, (("pad_n_m", "pad", "estimate"),)),
            ("pad, east (m)", 1.0, (("pad_e_m", "pad", "estimate"),)),
            ("pad, down (m)", 1.0, (("pad_d_m", "pad", "estimate"),)),
        ),
    ),
)


def inner_states(record: Record) -> list[Panel]:
    """A panel for each group of which the filter estimated a state; none where the record holds no such states."""
    return [panel for group in GROUPS if (panel := _panel(record, group)) is not None]


def _panel(record: Record, group: Group) -> Panel | None:
    rows = [
        (title, scale, found)
        for title, scale, drawn in group.rows
        if (found := [one for one in drawn if _estimated(record, one[0])])
    ]
    if not rows:
        return None
    stack = Stack([title for title, _, _ in rows], row_height_px=84 if len(rows) > 3 else 110)
    for row, (_, scale, found) in enumerate(rows, 1):
        for column, name, role in found:
            state = track(record, "states", (column, f"std_{column}"))
            if state is None:
                continue
            value, sigma = scale * state.value.T
            if name != "fast part":
                stack.band(row, "±3\N{GREEK SMALL LETTER SIGMA} stated", state.t_s, 3.0 * sigma, value)
            stack.line(row, role, name, state.t_s, value)
    chart = stack.chart(start_end_s(record), moments(record), outages(record))
    alt = f"{group.title} over time: {', '.join(title for title, _, _ in rows)}."
    return Panel(group.key, group.title, group.caption, alt, chart)


def _estimated(record: Record, column: str) -> bool:
    """Whether a state has a standard deviation above zero and either of them changes."""
    state = track(record, "states", (column, f"std_{column}"))
    if state is None:
        return False
    known = state.value[np.isfinite(state.value).all(axis=1)]
    return bool(len(known) > 1 and known[:, 1].max() > 0.0 and np.ptp(known, axis=0).max() > LEAST_CHANGE)
