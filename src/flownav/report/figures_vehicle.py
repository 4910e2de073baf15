"""Attitude and controls of the vehicle in time."""

from __future__ import annotations

import numpy as np

from flownav.measurement import Sensor
from flownav.record import QUATERNION, Record
from flownav.report.chart import Stack
from flownav.report.panels import Panel, listed
from flownav.report.series import LINE_POINTS, Track, estimates, euler_deg, moments, readings, start_end_s, thin, track

CONTROLS = {
    "lon_rad": "longitudinal (°)",
    "lat_rad": "lateral (°)",
    "col_rad": "collective (°)",
    "ped_rad": "pedal (°)",
}


def attitude(record: Record) -> Panel:
    """Roll, pitch and yaw [deg] of truth, estimate and autopilot; of the attitude sensor where none of them has any."""
    key, title = "attitude", "Attitude"
    sources, own = estimates(record, QUATERNION), readings(record, Sensor.ATTITUDE)
    if not sources and own is not None:
        sources = [("estimate", "attitude sensor", own)]
    if not sources:
        return Panel(key, title, absent="The record holds no attitude.")
    stack = Stack(("roll (°)", "pitch (°)", "yaw (°)"))
    for role, name, source in sources:
        kept = thin(LINE_POINTS, *source.value[:, 1:].T)
        angles = euler_deg(Track(source.t_s[kept], source.value[kept]))
        for row in (1, 2, 3):
            stack.line(row, role, name, source.t_s[kept], _unbroken(angles[:, row - 1], row == 3))
    figure = stack.chart(start_end_s(record), moments(record))
    return Panel(key, title, "Z-Y-X Euler angles of body against earth; drawn in degrees.",
                 f"Roll, pitch and yaw in degrees: {listed(stack.names)}.", figure)  # fmt: skip


def _unbroken(angle_deg: np.ndarray, is_yaw: bool) -> np.ndarray:
    """A yaw that does not leap at +-180 degrees."""
    if not is_yaw or np.isnan(angle_deg).any():
        return angle_deg
    return np.unwrap(angle_deg, period=360.0)


def controls(record: Record) -> Panel:
    """The controls [deg] and, where known, the rotor thrust [N]."""
    key, title = "controls", "Controls"
    columns = [name for name in CONTROLS if track(record, "command", (name,)) is not None]
    thrust = track(record, "truth", ("thrust_n",))
    if not columns and thrust is None:
        return Panel(key, title, absent="The record holds no commands.")
    titles = [CONTROLS[name] for name in columns] + (["thrust (N)"] if thrust is not None else [])
    stack = Stack(titles, row_height_px=118)
    for row, name in enumerate(columns, 1):
        command = track(record, "command", (name,))
        if command is not None:
            stack.line(row, "estimate", "command", command.t_s, np.degrees(command.value[:, 0]))
    if thrust is not None:
        stack.line(len(titles), "truth", "true thrust", thrust.t_s, thrust.value[:, 0])
    figure = stack.chart(start_end_s(record), moments(record))
    return Panel(key, title, "Angles of the swash plate and the blades, as commanded.",
                 f"Controls over time: {listed(titles)}.", figure)  # fmt: skip
