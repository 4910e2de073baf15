"""Synthetic logs for the replay's tests: a vehicle on a known path, its sensors without error, written as CSV files."""

from __future__ import annotations

import csv
import math
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pymap3d

from flownav.core.frames import GRAVITY_M_S2

ORIGIN = (47.0, 8.5, 400.0)
GPS_DELAY_S = 0.22
DECLINATION_RAD = math.radians(3.5)  # there, by NOAA's World Magnetic Model 2025
FIELD_MGAUSS = (210.0 * math.cos(DECLINATION_RAD), 210.0 * math.sin(DECLINATION_RAD), 430.0)


@dataclass
class SyntheticLog:
    """Tables by file name, columns by name, and the truth on a fine grid."""

    tables: dict[str, dict[str, np.ndarray]]
    t_s: np.ndarray = field(default_factory=lambda: np.zeros(0))
    position: np.ndarray = field(default_factory=lambda: np.zeros((0, 3)))
    velocity: np.ndarray = field(default_factory=lambda: np.zeros((0, 3)))

    def write(self, folder: Path) -> Path:
        folder.mkdir(parents=True, exist_ok=True)
        for name, columns in self.tables.items():
            write_table(folder / f"{name}.csv", columns)
        return folder


def write_table(path: Path, columns: dict[str, np.ndarray]) -> None:
    with path.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(columns)
        writer.writerows(zip(*(map(_text, values) for values in columns.values()), strict=True))


def _text(value: float) -> str:
    return str(int(value)) if float(value).is_integer() else f"{value:.12g}"


def path(t_s: np.ndarray) -> np.ndarray:
    """Climb to about 3 m in the first seconds, then lissajous laps of 10 m with gentle changes of height."""
    begun = np.clip((t_s - 3.0) / 5.0, 0.0, 1.0)
    rise = begun**3 * (10.0 - 15.0 * begun + 6.0 * begun**2)
    u = np.clip(t_s - 5.0, 0.0, None)
    soft = u**3 / (u**2 + 9.0)  # moves off from rest with continuous acceleration
    return np.column_stack([
        10.0 * np.sin(0.25 * soft), 6.0 * np.sin(0.4 * soft), -3.0 * rise - 0.4 * rise * np.sin(0.3 * soft),
    ])  # fmt: skip


def log_of_flight(duration_s: float = 60.0, *, start_s: float = 0.0, yaw_rate: float = 0.05, imu_hz: float = 50.0,
                  attitude_hz: float = 50.0, flow_hz: float = 20.0, gps_hz: float = 5.0, range_hz: float = 20.0,
                  sensor_gyro: bool = True,
                  along: Callable[[np.ndarray], np.ndarray] = path) -> SyntheticLog:  # fmt: skip
    """A log without any error but its sampling. Thrust lies along body z, so the attitude follows from the path."""
    fine = 1000.0
    t = np.arange(-1.0, duration_s + 1.0, 1.0 / fine)
    position = along(t)
    velocity = np.gradient(position, t, axis=0)
    force = np.gradient(velocity, t, axis=0) - np.array([0.0, 0.0, GRAVITY_M_S2])
    roll, pitch, yaw = _attitude(force, yaw_rate * t + 0.3)
    body_force = np.column_stack([np.zeros_like(t), np.zeros_like(t), -np.linalg.norm(force, axis=1)])
    rates = _rates(t, roll, pitch, yaw)
    body_velocity = _to_body(roll, pitch, yaw, velocity)
    height = 0.2 - position[:, 2]
    boresight = height / (np.cos(roll) * np.cos(pitch))
    flow = rates[:, :2] + np.column_stack([-body_velocity[:, 1], body_velocity[:, 0]]) / boresight[:, None]

    def at(instants: np.ndarray, values: np.ndarray) -> np.ndarray:
        return np.column_stack([np.interp(instants, t, column) for column in values.T])

    def mean(instants: np.ndarray, values: np.ndarray, period: float) -> np.ndarray:
        integral = np.cumsum(values, axis=0) / fine
        return (at(instants, integral) - at(instants - period, integral)) / period

    def times(hz: float) -> np.ndarray:
        return np.arange(0.0, duration_s, 1.0 / hz)

    tables: dict[str, dict[str, np.ndarray]] = {}
    s = times(attitude_hz)
    tables["attitude"] = _table(s, start_s, ("roll_rad", "pitch_rad"), at(s, np.column_stack([roll, pitch])))
    tables["attitude"]["yaw_rad"] = (np.interp(s, t, yaw) + np.pi) % (2 * np.pi) - np.pi
    s = times(imu_hz)
    names = (*(f"gyro_{a}_rad_s" for a in "xyz"), *(f"accel_{a}_m_s2" for a in "xyz"))
    tables["imu"] = _table(s, start_s, names, at(s, np.column_stack([rates, body_force])))
    s = times(gps_hz)
    fix = at(s - GPS_DELAY_S, np.column_stack([position, velocity]))
    latitude, longitude, altitude = pymap3d.ned2geodetic(*fix[:, :3].T, *ORIGIN)
    tables["gps"] = _table(s, start_s, ("fix_type", "lat_deg", "lon_deg", "alt_m"),
                           np.column_stack([np.full(len(s), 3.0), latitude, longitude, altitude]))  # fmt: skip
    tables["gps"] |= dict(zip(("vel_n_m_s", "vel_e_m_s", "vel_d_m_s"), fix[:, 3:].T, strict=True))
    s = times(flow_hz)
    tables["flow"] = _table(s, start_s, ("flow_x_rad_s", "flow_y_rad_s"), mean(s, flow, 1.0 / flow_hz))
    if sensor_gyro:
        seen = mean(s, rates[:, :2], 1.0 / flow_hz)
        tables["flow"] |= {"gyro_x_rad_s": seen[:, 0], "gyro_y_rad_s": seen[:, 1]}
    tables["flow"]["quality"] = np.full(len(s), 255.0)
    s = times(range_hz)
    tables["range"] = _table(s, start_s, ("range_m",), at(s, boresight[:, None])) | {"valid": np.ones(len(s))}
    s = times(10.0)
    tables["baro"] = _table(s, start_s, ("alt_m",), 12.0 + at(s, -position[:, 2:]))
    field = _to_body(*(np.interp(s, t, angle) for angle in (roll, pitch, yaw)), np.tile(FIELD_MGAUSS, (len(s), 1)))
    tables["mag"] = _table(s, start_s, ("mag_x_mgauss", "mag_y_mgauss", "mag_z_mgauss"), field)
    return SyntheticLog(tables, t + start_s, position - along(np.array([-GPS_DELAY_S])), velocity)


def _table(t_s: np.ndarray, start_s: float, names: tuple[str, ...], values: np.ndarray) -> dict[str, np.ndarray]:
    return {"t_s": t_s + start_s, **dict(zip(names, values.T, strict=True))}


def _attitude(force: np.ndarray, yaw: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Roll and pitch that put body -z along the specific force at the given yaw."""
    up = force / np.linalg.norm(force, axis=1)[:, None]
    ahead = np.cos(yaw) * up[:, 0] + np.sin(yaw) * up[:, 1]
    right = -np.sin(yaw) * up[:, 0] + np.cos(yaw) * up[:, 1]
    return np.arcsin(right), np.arctan2(-ahead, -up[:, 2]), yaw


def _rates(t: np.ndarray, roll: np.ndarray, pitch: np.ndarray, yaw: np.ndarray) -> np.ndarray:
    """Body rates of Z-Y-X Euler angles."""
    droll, dpitch, dyaw = (np.gradient(angle, t) for angle in (roll, pitch, yaw))
    return np.column_stack([
        droll - dyaw * np.sin(pitch),
        dpitch * np.cos(roll) + dyaw * np.sin(roll) * np.cos(pitch),
        -dpitch * np.sin(roll) + dyaw * np.cos(roll) * np.cos(pitch),
    ])  # fmt: skip


def _to_body(roll: np.ndarray, pitch: np.ndarray, yaw: np.ndarray, vector: np.ndarray) -> np.ndarray:
    """Earth to body, rotation by rotation (yaw, pitch, roll): written apart from the package's frames on purpose."""
    n, e, d = vector.T
    x, y = np.cos(yaw) * n + np.sin(yaw) * e, -np.sin(yaw) * n + np.cos(yaw) * e
    x, z = np.cos(pitch) * x - np.sin(pitch) * d, np.sin(pitch) * x + np.cos(pitch) * d
    return np.column_stack([x, np.cos(roll) * y + np.sin(roll) * z, -np.sin(roll) * y + np.cos(roll) * z])
