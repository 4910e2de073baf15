"""Rotor drag per mass and hover's tilt in the recorded outdoor flights, beside the shipped quadrotor's.

python tools/multirotor_drag.py [FOLDER]    (the folder of the logs; FLOWNAV_DATA otherwise)
"""

from __future__ import annotations

import os
import sys
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from flownav.core.record import QUATERNION
from flownav.simulation.assemble import assemble
from flownav.simulation.engine import fly_one
from flownav.simulation.history import column
from flownav.simulation.scenario import load_scenario, with_vehicle
from flownav.simulation.sensing import EPOCH_S
from flownav.vehicle.kinds import load_vehicle
from flownav.vehicle.multirotor import derivative
from flownav.vehicle.parameters import MultirotorParameters
from flownav.vehicle.trim import is_hexa, trim_multirotor

Array = NDArray[np.float64]
Columns = dict[str, Array]

LOGS = ("quad-px4flow-outdoor", "quad-px4flow-outdoor-2", "quad-px4flow-outdoor-3")
STEP_S, MEAN_S, HOVER_MEAN_S = 0.2, 1.0, 4.0
HOVERS_S = (12.0, 23.0)  # in pad_return
GPS_LATE_S, ENDS_S = 0.22, 30.0
FLYING_M_S, HOVERING_M_S = 0.3, 0.6
SPEEDS_M_S = (1.0, 4.0, 8.0)


def columns_of(file: Path) -> Columns:
    """A CSV file's columns by name."""
    names = file.open(encoding="utf-8").readline().strip().split(",")
    rows = np.genfromtxt(file, delimiter=",", skip_header=1)
    return {name: rows[:, i] for i, name in enumerate(names)}


def running_mean(t_s: Array, x: Array, at_s: Array, over_s: float) -> Array:
    """The mean of x over `over_s` about each instant."""
    total = np.concatenate([[0.0], np.cumsum(np.diff(t_s) * 0.5 * (x[1:] + x[:-1]))])
    return (np.interp(at_s + 0.5 * over_s, t_s, total) - np.interp(at_s - 0.5 * over_s, t_s, total)) / over_s


def drag_equations(folder: Path) -> tuple[Array, Array, Array]:
    """Rows (m, 5) and values (m,) of force = -k·(velocity - wind) + bias, unknown k, k·wind N, E, biases; and speeds.

    Rows of the body's x axis first, those of y in the second half.
    """
    imu, attitude, gps = (columns_of(folder / f"{name}.csv") for name in ("imu", "attitude", "gps"))
    at_s = np.arange(gps["t_s"][0] + ENDS_S, gps["t_s"][-1] - ENDS_S, STEP_S)
    north, east = (running_mean(gps["t_s"] - GPS_LATE_S, gps[f"vel_{axis}_m_s"], at_s, MEAN_S) for axis in "ne")
    felt = [running_mean(imu["t_s"], imu[f"accel_{axis}_m_s2"], at_s, MEAN_S) for axis in "xy"]
    yaw = np.interp(at_s, attitude["t_s"], np.unwrap(attitude["yaw_rad"]))
    cosine, sine = np.cos(yaw), np.sin(yaw)
    forward, right = cosine * north + sine * east, cosine * east - sine * north
    flying, one, none = np.hypot(north, east) > FLYING_M_S, np.ones_like(yaw), np.zeros_like(yaw)
    along = np.stack([-forward, cosine, sine, one, none], 1)[flying]
    across = np.stack([-right, -sine, cosine, none, one], 1)[flying]
    speed = np.hypot(north, east)
    return np.concatenate([along, across]), np.concatenate([x[flying] for x in felt]), speed


def hover_tilt_deg(folder: Path) -> tuple[float, float, float]:
    """Standard deviations of roll and pitch about 4 s means [deg] while nearly at rest, and for how long [s]."""
    attitude, gps = columns_of(folder / "attitude.csv"), columns_of(folder / "gps.csv")
    t_s = attitude["t_s"]
    inside = (t_s > gps["t_s"][0] + ENDS_S) & (t_s < gps["t_s"][-1] - ENDS_S)
    speed = np.hypot(*(running_mean(gps["t_s"] - GPS_LATE_S, gps[f"vel_{axis}_m_s"], t_s, MEAN_S) for axis in "ne"))
    still = inside & (speed < HOVERING_M_S)
    found = [
        float(np.degrees(np.std((x - running_mean(t_s, x, t_s, HOVER_MEAN_S))[still])))
        for x in (attitude["roll_rad"], attitude["pitch_rad"])
    ]
    return found[0], found[1], float(np.count_nonzero(still) * np.median(np.diff(t_s)))


def model_drag_1_s(vehicle: MultirotorParameters, speed_m_s: float) -> float:
    """Specific force along the body's x axis per airspeed in trimmed flight, as an accelerometer has it [1/s]."""
    about = trim_multirotor(vehicle, (speed_m_s, 0.0, 0.0))
    rate = derivative(about.state, about.controls, 0.0, 0.0, 0.0, is_hexa(vehicle), vehicle)
    gravity = -vehicle.gravity_m_s2 * np.sin(about.pitch_rad)
    return float((gravity - rate.u) / speed_m_s)


def flown_tilt_deg(flights: int = 8) -> tuple[float, float]:
    """The same of the simulated quadrotor, hovering in the wind of `pad_return`, 4 m/s with gusts [deg]."""
    flight = assemble(with_vehicle(load_scenario("pad_return"), "quad-450")).flight
    squares = np.zeros(2)
    for index in range(flights):
        history = fly_one(flight, 1, index)[:, :, 0]
        w, x, y, z = (history[:, column("truth", name)] for name in QUATERNION)
        t_s = EPOCH_S * np.arange(len(w))
        hover = (t_s > HOVERS_S[0]) & (t_s < HOVERS_S[1])
        roll, pitch = np.arctan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y)), np.arcsin(2.0 * (w * y - z * x))
        for i, angle in enumerate((roll, pitch)):
            squares[i] += np.var((angle - running_mean(t_s, angle, t_s, HOVER_MEAN_S))[hover]) / flights
    roll_deg, pitch_deg = np.degrees(np.sqrt(squares))
    return float(roll_deg), float(pitch_deg)


def main(data: Path) -> None:
    """Print both tables."""
    for name in LOGS:
        rows, felt, speed = drag_equations(data / name)
        half = len(rows) // 2
        quarters = [np.r_[i * half // 4 : (i + 1) * half // 4] for i in range(4)]
        parts = [
            np.linalg.lstsq(rows[np.r_[q, q + half]], felt[np.r_[q, q + half]], rcond=None)[0][0] for q in quarters
        ]
        whole = np.linalg.lstsq(rows, felt, rcond=None)[0][0]
        shown = " ".join(f"{part:6.3f}" for part in parts)
        roll, pitch, hovered_s = hover_tilt_deg(data / name)
        print(
            f"{name:24} drag {whole:.3f} 1/s, by quarters {shown}; up to {speed.max():.1f} m/s; "
            f"hover {hovered_s:.0f} s: roll {roll:.2f}, pitch {pitch:.2f} deg"
        )
    vehicle = load_vehicle(Path("quad-450"))
    assert isinstance(vehicle, MultirotorParameters)
    print("quad-450: " + ", ".join(f"{model_drag_1_s(vehicle, v):.3f} 1/s at {v:g} m/s" for v in SPEEDS_M_S))
    print("quad-450, hover in 4 m/s of wind: roll {:.2f}, pitch {:.2f} deg".format(*flown_tilt_deg()))


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else os.environ["FLOWNAV_DATA"]))
