"""Attitude and controls of the vehicle in time."""

from __future__ import annotations

import numpy as np

from flownav.core.measurement import COLUMNS, Sensor
from flownav.core.record import QUATERNION, Record
from flownav.report.chart import Stack
from flownav.report.panels import Panel, listed
from flownav.report.samples import sliding_mean, sliding_rms, thin
from flownav.report.series import Track, estimates, euler_deg, moments, outages, readings, start_end_s, track

LEAST_IMU_HZ = 20.0
SLOW_S, SHAKEN_S = 0.3, 1.0
ATTITUDE_POINTS = 6000  # rows of an attitude that are turned into angles
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
        kept = thin(ATTITUDE_POINTS, *source.value[:, 1:].T)
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


def vibration(record: Record) -> list[Panel]:
    """How much the vehicle shakes its IMU: what is faster than a slow mean, rms over a sliding window; none without."""
    imu = track(record, "imu", COLUMNS[Sensor.IMU])
    if imu is None or len(imu.t_s) < 2 or (len(imu.t_s) - 1) / max(np.ptp(imu.t_s), 1e-9) < LEAST_IMU_HZ:
        return []
    stack = Stack(("accelerometer (m/s²)", "gyro (°/s)"), row_height_px=120)
    shaken = []
    for row, columns, scale in ((1, slice(3, 6), 1.0), (2, slice(0, 3), 57.29577951308232)):
        fast = [values - sliding_mean(imu.t_s, values, SLOW_S) for values in imu.value[:, columns].T]
        squares = np.nan_to_num(np.sum(np.square(fast), axis=0))
        shaken.append(scale * sliding_rms(imu.t_s, squares, SHAKEN_S))
        stack.line(row, "imu", "vibration", imu.t_s, shaken[-1])
    stack.from_zero()
    caption = (
        f"Length of what the IMU reads beyond its mean over {SLOW_S:g} s, rms over a sliding {SHAKEN_S:g} s: "
        f"in the median {np.median(shaken[0]):.2f} m/s² and {np.median(shaken[1]):.2f} °/s, "
        f"at most {np.max(shaken[0]):.2f} m/s² and {np.max(shaken[1]):.2f} °/s."
    )
    chart = stack.chart(start_end_s(record), moments(record), outages(record))
    return [Panel("vibration", "Vibration", caption, f"Vibration of the IMU over time. {caption}", chart)]
