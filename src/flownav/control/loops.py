"""The autopilot's laws as signals of frequency, and each loop as it is where every other one is closed.

The flight kernel runs `autopilot.inner_loop` at 250 Hz and `autopilot.outer_loop` at 50 Hz, each holding its commands.
Here the same laws stand as frequency responses between the signals at which a loop can be cut: the four blade
commands, the measured body rates, and the commands that the outer loops hand to the inner ones. With F(jω) the matrix
that takes these signals round to themselves, cutting signal i and leaving all others closed shows the loop

    L_i(jω) = 1/[(I - F)⁻¹]_ii - 1        (so that the closed loop is stable up to L_i = -1)

Sampling and holding are in it exactly but for what folds back from above half the sampling rate.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from flownav.control.gains import AutopilotGains
from flownav.core.frames import GRAVITY_M_S2
from flownav.vehicle.plant import INPUTS, OUTPUTS, Complex

INNER_S = 0.004
OUTER_S = 0.02
# from what the estimate says to when it says it: one period of the outer loop, for transport and computing
ESTIMATE_DELAY_S = 0.02

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

Array = NDArray[np.float64]


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
