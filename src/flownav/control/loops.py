"""The autopilot's loops, each as it is where every other one is closed: by frequency, and as they are sampled.

The flight kernel runs `autopilot.inner_loop` at 250 Hz and `autopilot.outer_loop` at 50 Hz, each holding its commands.
Here the same laws stand as frequency responses between the signals at which a loop can be cut: the four blade commands,
the measured body rates, and the commands that the outer loops pass to the inner ones. With F(jω) the matrix that takes
these signals round to themselves, cutting signal i and leaving all others closed shows the loop

    L_i(jω) = 1/[(I - F)⁻¹]_ii - 1        (so that the closed loop is stable up to L_i = -1)

Sampling and holding are in it exactly but for what folds back from above half the sampling rate.

`period_map` is the closed loop as it is flown, exactly: a linear plant, the attitude loop every 4 ms, the outer loop
every 20 ms. One period of the outer loop is one matrix. Its largest eigenvalue says whether the loop is stable,
sampling, holding and the estimate's delay (whole periods of the outer loop) included: the margins, which are read from
frequency responses, are proven on it.
"""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from flownav.control.gains import AutopilotGains
from flownav.core.frames import GRAVITY_M_S2
from flownav.core.measurement import Array
from flownav.vehicle.linearize import INPUTS, OUTPUTS, Complex, LinearPlant

INNER_S = 0.004
OUTER_S = 0.02
# from what the estimate says to when it says it: one period of the outer loop, for transport and computing
ESTIMATE_DELAY_S = 0.02
TAYLOR_TERMS = 16  # of a matrix of norm 1/2: what is left out is below 1e-19

# where a loop is cut: its name, and the signal's
CUTS = {
    "pitch": "lon",
    "roll": "lat",
    "heave": "col",
    "yaw": "ped",
    "pitch rate": "q",
    "roll rate": "p",
    "yaw rate": "r",
    "velocity forward": "pitch_command",
    "velocity right": "roll_command",
    "position forward": "vel_n_command",
    "position right": "vel_e_command",
    "height": "vel_d_command",
}
LOOPS = tuple(CUTS)
SIGNALS = tuple(CUTS.values())
PLACE = {name: i for i, name in enumerate(SIGNALS)}
_BLADES = [PLACE[name] for name in INPUTS]


class Timing(NamedTuple):
    """Periods of the two loops, and how late the estimate is that the outer one takes [s]."""

    inner_s: float = INNER_S
    outer_s: float = OUTER_S
    estimate_delay_s: float = ESTIMATE_DELAY_S


FLOWN = Timing()


def hold(omega_rad_s: Array, period_s: float) -> Complex:
    """A zero-order hold: (1 - e^(-jωT))/(jωT)."""
    half = 0.5 * omega_rad_s * period_s
    return np.asarray(np.sinc(half / np.pi) * np.exp(-1j * half))


def integral(omega_rad_s: Array, period_s: float) -> Complex:
    """A summed integrator whose output is used before it is added to: T/(e^(jωT) - 1)."""
    return np.asarray(period_s / np.expm1(1j * omega_rad_s * period_s))


def around(response: Complex, omega_rad_s: Array, gains: AutopilotGains, timing: Timing = FLOWN) -> Complex:
    """F(jω), (n, signals, signals), of a plant's response (n, OUTPUTS, INPUTS) under the autopilot.

    F[i, k] is what one unit of signal k makes of signal i by one way round, through no other signal.
    """
    found = np.zeros((len(omega_rad_s), len(SIGNALS), len(SIGNALS)), complex)
    for signal, sources in _laws(omega_rad_s, gains, timing).items():
        for source, gain in sources.items():
            if source in PLACE:
                found[:, PLACE[signal], PLACE[source]] += gain
            else:
                found[:, PLACE[signal], _BLADES] += _by_blades(response, source) * np.reshape(gain, (-1, 1))
    for rate in ("p", "q", "r"):
        found[:, PLACE[rate], _BLADES] = _by_blades(response, rate)
    return found


def loop_gains(response: Complex, omega_rad_s: Array, gains: AutopilotGains, timing: Timing = FLOWN) -> Complex:
    """L(jω) of each loop of LOOPS with every other one closed, (n, loops)."""
    circle = np.eye(len(SIGNALS)) - around(response, omega_rad_s, gains, timing)
    return np.asarray(1.0 / np.diagonal(np.linalg.inv(circle), axis1=1, axis2=2) - 1.0)


def _by_blades(response: Complex, output: str) -> Complex:
    """How an output answers the four blade commands, (n, INPUTS)."""
    return response[:, OUTPUTS.index(output), :]


def _laws(w: Array, g: AutopilotGains, timing: Timing) -> dict[str, dict[str, Any]]:
    """Each commanded signal as a sum of outputs and other signals, each with its frequency response."""
    inner, outer = hold(w, timing.inner_s), hold(w, timing.outer_s)
    fast, slow = integral(w, timing.inner_s), integral(w, timing.outer_s)
    late = np.exp(-1j * w * timing.estimate_delay_s)
    tilt = {  # the commanded tilt is held over an outer period, of which the inner loop sees every sample
        "pitch": g.pitch_gain + g.pitch_integral * fast,
        "roll": g.roll_gain + g.roll_integral * fast,
    }
    heading = g.yaw_rate_gain + g.yaw_rate_integral * fast
    forward = (g.forward_gain + g.forward_integral * slow) / GRAVITY_M_S2
    right = (g.right_gain + g.right_integral * slow) / GRAVITY_M_S2
    # the disturbance observer: what is felt over an outer period, less what the tilt explains, low-passed
    ahead, aside = (
        g.gust_share * (1.0 - decay) / (1.0 - decay * np.exp(-1j * w * timing.outer_s)) * outer * late
        for decay in (g.gust_decay_forward, g.gust_decay_right)
    )
    per_velocity = 1j * w / GRAVITY_M_S2
    lift = g.collective_gain + g.collective_integral * slow
    return {
        "lon": {"pitch": -inner * tilt["pitch"], "pitch_command": outer * tilt["pitch"], "q": -inner * g.pitch_damping},
        "lat": {"roll": -inner * tilt["roll"], "roll_command": outer * tilt["roll"], "p": -inner * g.roll_damping},
        "ped": {"heading": -inner * heading * g.heading_gain, "r": -inner * heading, "col": g.pedal_per_collective},
        "col": {"vel_d_command": -outer * lift, "vel_d": outer * lift * late},
        "pitch_command": {"vel_n_command": -forward, "vel_n": forward * late + per_velocity * ahead, "pitch": ahead},
        "roll_command": {"vel_e_command": right, "vel_e": -right * late - per_velocity * aside, "roll": aside},
        "vel_n_command": {"pos_n": -late * g.position_gain},
        "vel_e_command": {"pos_e": -late * g.position_gain},
        "vel_d_command": {"pos_d": -late * g.height_gain},
    }


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


def exponential(matrix: Array) -> Array:
    """e to a matrix (n, n), to rounding: Taylor's series of what is halved until it is small, squared again.

    Moler and Van Loan, SIAM Review 45, 2003, method 3. SciPy's would cost every flight half a second to load.
    """
    halvings = max(0, int(np.ceil(np.log2(max(float(np.linalg.norm(matrix, 1)), 1e-300)))) + 1)
    small, found = matrix / 2.0**halvings, np.eye(len(matrix))
    for order in range(TAYLOR_TERMS, 0, -1):
        found = np.eye(len(matrix)) + small @ found / order
    return np.asarray(np.linalg.matrix_power(found, 2**halvings))


def _outer_map(g: AutopilotGains, timing: Timing, factor: Mapping[str, float], rows: _Rows, periods: int) -> Array:
    """`autopilot.outer_loop` about hover: held commands, integrators and the estimate's delay line."""
    now = {name: rows.seen[name] for name in LATE[:6]}
    tilt = {"n": rows.seen["pitch"], "e": -rows.seen["roll"]}
    for axis in "ne":  # means over the period that has passed, as the accelerometer has them
        mean = (rows.seen[f"vel_{axis}"] - rows.of[f"before_{axis}"]) / timing.outer_s
        now[f"felt_{axis}"] = mean + 0.5 * GRAVITY_M_S2 * (tilt[axis] + rows.of[f"tilt_before_{axis}"])
    stated = {name: rows.of[f"{name}_{periods - 1}"] if periods else now[name] for name in LATE}
    ask = {axis: -factor[f"vel_{axis}_command"] * g.position_gain * stated[f"pos_{axis}"] for axis in "ne"}
    error = {axis: ask[axis] - stated[f"vel_{axis}"] for axis in "ne"}
    down = -factor["vel_d_command"] * g.height_gain * stated["pos_d"] - stated["vel_d"]
    found = np.eye(rows.count)
    accel = {}
    for axis, name, gain, integral, decay in (
        ("n", "forward", g.forward_gain, g.forward_integral, g.gust_decay_forward),
        ("e", "right", g.right_gain, g.right_integral, g.gust_decay_right),
    ):  # fmt: skip
        gust = decay * rows.of[f"gust_{name}"] + (1.0 - decay) * stated[f"felt_{axis}"]
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
    step = exponential(np.block([[plant.a, plant.b], [np.zeros((m, n + m))]]) * timing.inner_s)[:n]
    found = np.eye(rows.count)
    found[:n] = step[:, n:] @ np.array([blades[name] for name in INPUTS])
    found[:n, :n] += step[:, :n]
    for name, error, gain in (
        ("lon_sum", pitch, g.pitch_integral), ("lat_sum", roll, g.roll_integral), ("ped_sum", yaw, g.yaw_rate_integral),
    ):  # fmt: skip
        found[rows.place[name]] += gain * timing.inner_s * error
    return found
