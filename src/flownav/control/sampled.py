"""The closed loop as it is flown, exactly: a linear plant, the attitude loop every 4 ms, the outer loop every 20 ms.

One period of the outer loop is one matrix. Its largest eigenvalue says whether the loop is stable, sampling, holding
and the estimate's delay (whole periods of the outer loop) included: the margins of `loops`, which are read from
frequency responses, are proven on it.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from flownav.control.gains import AutopilotGains
from flownav.control.loops import FLOWN, SIGNALS, Timing
from flownav.core.frames import GRAVITY_M_S2
from flownav.vehicle.plant import INPUTS, OUTPUTS, LinearPlant

Array = NDArray[np.float64]

# behind the plant's states: integrators and observers, held commands, what the delayed estimate was
MEMORY = (
    "lon_sum", "lat_sum", "ped_sum", "forward_sum", "right_sum", "collective_sum", "gust_forward", "gust_right",
    "pitch_command", "roll_command", "col", "before_n", "before_e", "tilt_before_n", "tilt_before_e",
)  # fmt: skip
LATE = ("pos_n", "pos_e", "pos_d", "vel_n", "vel_e", "vel_d", "felt_n", "felt_e")  # through the estimate's delay


class _Rows:
    """Rows of the closed loop's state as vectors, so that laws read as equations."""

    def __init__(self, plant: LinearPlant, periods: int) -> None:
        self.states = len(plant.a)
        self.late = [f"{name}_{k}" for k in range(periods) for name in LATE]
        names = (*MEMORY, *self.late)
        self.count = self.states + len(names)
        self.of = {name: self._unit(self.states + i) for i, name in enumerate(names)}
        self.place = {name: self.states + i for i, name in enumerate(names)}
        self.seen = {name: np.append(row, np.zeros(len(names))) for name, row in zip(OUTPUTS, plant.c, strict=True)}

    def _unit(self, index: int) -> Array:
        row = np.zeros(self.count)
        row[index] = 1.0
        return row


def period_map(
    plant: LinearPlant, gains: AutopilotGains, timing: Timing = FLOWN, scaled: Mapping[str, float] | None = None
) -> Array:
    """The closed loop's state one outer period later, as a matrix.

    scaled: factors on signals of `loops.SIGNALS`, to take a loop to its gain margin.
    """
    factor = dict.fromkeys(SIGNALS, 1.0) | dict(scaled or {})
    periods = round(timing.estimate_delay_s / timing.outer_s)
    rows = _Rows(plant, periods)
    inner = _inner_map(plant, gains, timing, factor, rows)
    steps = round(timing.outer_s / timing.inner_s)
    return np.linalg.matrix_power(inner, steps) @ _outer_map(gains, timing, factor, rows, periods)


def spectral_radius(plant: LinearPlant, gains: AutopilotGains, timing: Timing = FLOWN) -> float:
    """The largest eigenvalue of one outer period, in size; below 1: stable. Position has no trim: 1 without a pad."""
    return float(np.abs(np.linalg.eigvals(period_map(plant, gains, timing))).max())


def _outer_map(g: AutopilotGains, timing: Timing, factor: Mapping[str, float], rows: _Rows, periods: int) -> Array:
    """`autopilot.outer_loop` about hover: held commands, integrators and the estimate's delay line."""
    now = {name: rows.seen[name] for name in LATE[:6]}
    tilt = {"n": rows.seen["pitch"], "e": -rows.seen["roll"]}
    for axis in "ne":  # means over the period that has passed, as the accelerometer has them
        mean = (rows.seen[f"vel_{axis}"] - rows.of[f"before_{axis}"]) / timing.outer_s
        now[f"felt_{axis}"] = mean + 0.5 * GRAVITY_M_S2 * (tilt[axis] + rows.of[f"tilt_before_{axis}"])
    said = {name: rows.of[f"{name}_{periods - 1}"] if periods else now[name] for name in LATE}
    ask = {axis: -factor[f"vel_{axis}_command"] * g.position_gain * said[f"pos_{axis}"] for axis in "ne"}
    error = {axis: ask[axis] - said[f"vel_{axis}"] for axis in "ne"}
    down = -factor["vel_d_command"] * g.height_gain * said["pos_d"] - said["vel_d"]
    found = np.eye(rows.count)
    accel = {}
    for axis, name, gain, integral, decay in (
        ("n", "forward", g.forward_gain, g.forward_integral, g.gust_decay_forward),
        ("e", "right", g.right_gain, g.right_integral, g.gust_decay_right),
    ):  # fmt: skip
        gust = decay * rows.of[f"gust_{name}"] + (1.0 - decay) * said[f"felt_{axis}"]
        accel[axis] = gain * error[axis] + rows.of[f"{name}_sum"] - g.gust_share * gust
        found[rows.place[f"gust_{name}"]] = gust
        found[rows.place[f"{name}_sum"]] = rows.of[f"{name}_sum"] + integral * timing.outer_s * error[axis]
        found[rows.place[f"before_{axis}"]] = rows.seen[f"vel_{axis}"]
        found[rows.place[f"tilt_before_{axis}"]] = tilt[axis]
    found[rows.place["pitch_command"]] = -factor["pitch_command"] * accel["n"] / GRAVITY_M_S2
    found[rows.place["roll_command"]] = factor["roll_command"] * accel["e"] / GRAVITY_M_S2
    total = rows.of["collective_sum"]
    found[rows.place["col"]] = factor["col"] * (total - g.collective_gain * down)
    found[rows.place["collective_sum"]] = total - g.collective_integral * timing.outer_s * down
    for k in range(periods):
        for name in LATE:
            found[rows.place[f"{name}_{k}"]] = now[name] if k == 0 else rows.of[f"{name}_{k - 1}"]
    return found


def _inner_map(
    plant: LinearPlant, g: AutopilotGains, timing: Timing, factor: Mapping[str, float], rows: _Rows
) -> Array:
    """`autopilot.inner_loop` about hover and the plant over one inner period, the blade commands held."""
    see, of = rows.seen, rows.of
    rate = {name: factor[name] * see[name] for name in ("p", "q", "r")}
    pitch, roll = of["pitch_command"] - see["pitch"], of["roll_command"] - see["roll"]
    yaw = -g.heading_gain * see["heading"] - rate["r"]
    blades = {
        "lon": factor["lon"] * (g.pitch_gain * pitch - g.pitch_damping * rate["q"] + of["lon_sum"]),
        "lat": factor["lat"] * (g.roll_gain * roll - g.roll_damping * rate["p"] + of["lat_sum"]),
        "col": of["col"],
        "ped": factor["ped"] * (g.yaw_rate_gain * yaw + of["ped_sum"] + g.pedal_per_collective * of["col"]),
    }
    n, m = plant.b.shape
    step = expm(np.block([[plant.a, plant.b], [np.zeros((m, n + m))]]) * timing.inner_s)[:n]
    found = np.eye(rows.count)
    found[:n] = step[:, n:] @ np.array([blades[name] for name in INPUTS])
    found[:n, :n] += step[:, :n]
    for name, error, gain in (
        ("lon_sum", pitch, g.pitch_integral), ("lat_sum", roll, g.roll_integral), ("ped_sum", yaw, g.yaw_rate_integral),
    ):  # fmt: skip
        found[rows.place[name]] += gain * timing.inner_s * error
    return found
