"""Made logs with noise of known size, for the tuning's tests."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from replay_logs import SyntheticLog, log_of_flight, path, write_table

IMU_HZ = 50.0


def noisy_flight(
    folder: Path, *, seed: int = 100, duration_s: float = 80.0, gyro: float = 0.0005, accel: float = 0.01,
    flow_gain: float = 1.0, gps: bool = False, truth: bool = True,
) -> Path:  # fmt: skip
    """A flight without attitude; gyro [rad/s per root hertz] and accel [m/s2 per root hertz] are densities.

    Flow, range, barometer and GPS have the white noise of the shipped settings. flow_gain: reported over true flow of
    the velocity.
    """
    flown, draw = log_of_flight(duration_s, imu_hz=IMU_HZ), np.random.default_rng(seed)
    tables = flown.tables
    del tables["attitude"]
    for axis in "xy":
        turning = tables["flow"][f"gyro_{axis}_rad_s"]
        seen = tables["flow"][f"flow_{axis}_rad_s"] - turning
        tables["flow"][f"flow_{axis}_rad_s"] = turning + flow_gain * seen
    sigmas = {
        "imu": {"gyro_": gyro * IMU_HZ**0.5, "accel_": accel * IMU_HZ**0.5},
        "flow": {"flow_": 0.05},
        "range": {"range_m": np.hypot(0.05, 0.02 * tables["range"]["range_m"])},
        "baro": {"alt_m": 1.0},
        "gps": {"vel_": 0.4, "lat_deg": 0.4 / 111e3, "lon_deg": 0.4 / 76e3, "alt_m": 0.8},
    }
    for name, columns in sigmas.items():
        for start, sigma in columns.items():
            for column in [column for column in tables[name] if column.startswith(start)]:
                tables[name][column] = tables[name][column] + sigma * draw.standard_normal(len(tables[name]["t_s"]))
    if not gps:
        del tables["gps"]
    written = flown.write(folder)
    if truth:
        _write_truth(flown, written, duration_s)
    return written


def flight_in_mid_air(
    folder: Path, *, seed: int, duration_s: float = 45.0, gyro_bias: float = 0.0005, accel_bias: float = 0.05
) -> Path:
    """A log that begins in flight, on a part of the path that its seed draws: IMU, flow, range and truth.

    Noise is that of the shipped settings; gyro_bias [rad/s] and accel_bias [m/s2] are standard deviations of constants.
    """
    draw = np.random.default_rng(seed)
    begin = draw.uniform(10.0, 50.0)
    there = path(np.array([begin])) * (1.0, 1.0, 0.0)
    flown = log_of_flight(duration_s, imu_hz=IMU_HZ, along=lambda t_s: path(t_s + begin) - there)
    flown.tables = {name: flown.tables[name] for name in ("imu", "flow", "range")}

    def disturb(table: str, start: str, sigma: float, bias: float = 0.0) -> None:
        for column in [column for column in flown.tables[table] if column.startswith(start)]:
            noise = sigma * draw.standard_normal(len(flown.tables[table]["t_s"]))
            flown.tables[table][column] = flown.tables[table][column] + bias * draw.standard_normal() + noise

    disturb("imu", "gyro_", 0.004 * IMU_HZ**0.5, gyro_bias)
    disturb("imu", "accel_", 0.05 * IMU_HZ**0.5, accel_bias)
    disturb("flow", "flow_", 0.05)
    disturb("range", "range_m", 0.05)
    written = flown.write(folder)
    _write_truth(flown, written, duration_s)
    return written


def _write_truth(flown: SyntheticLog, folder: Path, duration_s: float) -> None:
    t_s = np.arange(0.0, duration_s - 0.5, 0.02)
    north, east, down = (np.interp(t_s, flown.t_s, column) for column in flown.position.T)
    write_table(folder / "truth.csv", {"t_s": t_s, "x_m": north, "y_m": east, "z_m": down})
