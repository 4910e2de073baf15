"""The pendulum with adjustable length: equations 12 to 16, its motion, and how it is moved.

The pivot is l0 above the pad, the sensor hangs l = l0 - h below it, h above the pad at rest. The angle theta is
positive towards +x. The paper's equations 13 to 15 are kept as printed (z upwards, velocities by derivative).

A free swing is a near-pure tone: it determines gain and latency, no more. Rods of several lengths give several tones;
the chirp and the steps, by a motor at the pivot, give a band.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flownav.core.compile import cos, equation, kernel, runge_kutta, sin, stepping
from flownav.core.errors import InputError
from flownav.core.measurement import Array
from flownav.lab.optics.projection import Pose

GRAVITY_M_S2 = 9.81
STEP_S = 0.5e-3


@equation
def sensor_place(angle_rad: float, length_m: float, height_m: float) -> tuple[float, float]:
    """Equations 12 and 13: x = l sin(theta), z = d + l - l cos(theta) [m]; d is the height at rest."""
    return length_m * sin(angle_rad), height_m + length_m - length_m * cos(angle_rad)


@equation
def sensor_velocity(angle_rad: float, rate_rad_s: float, length_m: float) -> tuple[float, float]:
    """Equations 14 and 15: vx = l cos(theta) theta', vz = l sin(theta) theta' [m/s]."""
    return length_m * cos(angle_rad) * rate_rad_s, length_m * sin(angle_rad) * rate_rad_s


@equation
def largest_speed(start_angle_rad: float, pivot_height_m: float, height_m: float) -> float:
    """Equation 16, small swings: v_max = sqrt(g l0 (1 - h/l0)) theta0 [m/s], at the lowest place."""
    speed_m_s: float = np.sqrt(GRAVITY_M_S2 * pivot_height_m * (1.0 - height_m / pivot_height_m)) * start_angle_rad
    return speed_m_s


@equation
def swing_acceleration(
    angle_rad: float, rate_rad_s: float, push_rad_s2: float, length_m: float, damping_1_s: float
) -> float:
    """theta'' = -(g/l) sin(theta) - 2 sigma theta' + push: amplitude falls as exp(-sigma t) [rad/s²]."""
    gravity_rad_s2: float = GRAVITY_M_S2 / length_m * sin(angle_rad)
    return push_rad_s2 - gravity_rad_s2 - 2.0 * damping_1_s * rate_rad_s


class Rod(NamedTuple):
    """A rod that swings: its angle [rad] and how fast it turns [rad/s]."""

    angle_rad: float
    rate_rad_s: float


_, classical_step = runge_kutta(stepping(Rod))


@equation
def rate_of_swing(rod: Rod, push_rad_s2: float, length_m: float, damping_1_s: float) -> Rod:
    """How fast a free rod's angle and its rate change [rad/s, rad/s²]."""
    angle_rad, rate_rad_s = rod
    return Rod(rate_rad_s, swing_acceleration(angle_rad, rate_rad_s, push_rad_s2, length_m, damping_1_s))


@equation
def servo_acceleration(angle_rad: float, rate_rad_s: float, wanted_rad: float, servo_rad_s: float) -> float:
    """A motor at the pivot that holds the rod to an angle, critically damped, gravity cancelled [rad/s²]."""
    return servo_rad_s * (servo_rad_s * (wanted_rad - angle_rad) - 2.0 * rate_rad_s)


@equation
def sensor_pose(angle_rad: float, length_m: float, height_m: float, along_x: bool, x0_m: float) -> Pose:
    """The camera on the rod (section 4.7): it swings with the rod and looks along it.

    Its x axis lies along the swing, or its y axis where `along_x` is false; `x0_m` is where on the pad it hangs.
    """
    x_m, z_m = sensor_place(angle_rad, length_m, height_m)
    sine, cosine = sin(angle_rad), cos(angle_rad)
    c, s = (1.0, 0.0) if along_x else (0.0, -1.0)  # the camera's turn about its own axis: 0 or -90 degrees
    return Pose(x_m + x0_m, 0.0, z_m, cosine * c, -cosine * s, sine, s, c, 0.0, -sine * c, sine * s, cosine)


@kernel
def swing(push_rad_s2, length_m, damping_1_s, angle_rad, rate_rad_s):  # type: ignore[no-untyped-def]
    """Free swing after a push, fourth-order Runge-Kutta; one value a step of STEP_S, from rest."""
    rod = Rod(0.0, 0.0)
    for k in range(len(push_rad_s2)):
        angle_rad[k], rate_rad_s[k] = rod.angle_rad, rod.rate_rad_s
        rod = classical_step(rate_of_swing, rod, STEP_S, push_rad_s2[k], length_m, damping_1_s)


@kernel
def driven(wanted_rad, servo_rad_s, angle_rad, rate_rad_s):  # type: ignore[no-untyped-def]
    """The rod under the motor, from rest at the first wanted angle; one value a step of STEP_S."""
    theta, omega = wanted_rad[0], 0.0
    for k in range(len(wanted_rad)):
        angle_rad[k], rate_rad_s[k] = theta, omega
        omega += STEP_S * servo_acceleration(theta, omega, wanted_rad[k], servo_rad_s)
        theta += STEP_S * omega


def push_for(angle_rad: float, push_s: float, length_m: float) -> float:
    """Peak of a half-sine push of `push_s` seconds that leaves a swing of this amplitude (small swings) [rad/s²]."""
    natural = np.sqrt(GRAVITY_M_S2 / length_m)
    t = (np.arange(2000) + 0.5) * push_s / 2000.0
    swing_of_unit = abs(np.sum(np.sin(np.pi * t / push_s) * np.exp(1j * natural * t))) * push_s / 2000.0 / natural
    return float(angle_rad / swing_of_unit)


def half_sine(count: int, start_s: float, length_s: float, peak: float) -> NDArray[np.float64]:
    """A push of half a sine, as an array with one value a step of STEP_S."""
    t = np.arange(count) * STEP_S - start_s
    return np.where((t >= 0.0) & (t <= length_s), peak * np.sin(np.pi * t / length_s), 0.0)


# -- excitation: free swing, several rod lengths, chirp, steps ---------------------------------------------------
EXCITATIONS = ("swing", "lengths", "chirp", "steps")
DAMPING_1_S = 0.04
HAND_PUSH_S = 1.0
HAND_SPREAD = 0.05  # from run to run: strength of the push, and twice as much in its duration
REST_S = 1.0
CHIRP_HZ = (0.3, 4.0)
SERVO_RAD_S = 2.0 * np.pi * 8.0
STEP_HOLD_S = (0.3, 1.2)
LARGEST_ANGLE_RAD = 0.2
SHORTEST_ROD_M = 0.25


class Motion(NamedTuple):
    """The rod's motion: angle [rad] and rate [rad/s], one a step of STEP_S."""

    time_s: Array
    angle_rad: Array
    rate_rad_s: Array


def rod_length(excitation: str, pivot_height_m: float, height_m: float, run: int, runs: int) -> float:
    """Length of the rod in a run [m]: l0 - h; for `lengths` from there to SHORTEST_ROD_M, their tones evenly apart."""
    longest = pivot_height_m - height_m
    if excitation != "lengths" or runs < 2:
        return longest
    slow, fast = np.sqrt(GRAVITY_M_S2 / longest), np.sqrt(GRAVITY_M_S2 / min(SHORTEST_ROD_M, longest))
    return float(GRAVITY_M_S2 / (slow + (fast - slow) * (run - 1) / (runs - 1)) ** 2)


def move(
    excitation: str, length_m: float, start_angle_rad: float, duration_s: float, rng: np.random.Generator
) -> Motion:
    """The rod's motion for `duration_s`, from rest; peak speed about sqrt(g l) theta0 (equation 16) in every kind."""
    count = round(duration_s / STEP_S) + 1
    angle, rate = np.zeros(count), np.zeros(count)
    speed_m_s = np.sqrt(GRAVITY_M_S2 * length_m) * start_angle_rad
    if excitation in ("swing", "lengths"):
        strength = 1.0 + HAND_SPREAD * rng.uniform(-1.0, 1.0)
        push_s = HAND_PUSH_S * min(1.0, np.sqrt(length_m)) * (1.0 + 2.0 * HAND_SPREAD * rng.uniform(-1.0, 1.0))
        peak = push_for(strength * start_angle_rad, push_s, length_m)
        swing(half_sine(count, REST_S, push_s, peak), length_m, DAMPING_1_S, angle, rate)
    elif excitation == "chirp":
        driven(_chirp(count, speed_m_s / length_m), SERVO_RAD_S, angle, rate)
    elif excitation == "steps":
        driven(_steps(count, speed_m_s / length_m, rng), SERVO_RAD_S, angle, rate)
    else:
        raise InputError(f"excitation {excitation!r}: unknown; known are {', '.join(EXCITATIONS)}")
    return Motion(np.linspace(0.0, (count - 1) * STEP_S, count), angle, rate)


def _chirp(count: int, rate_rad_s: float) -> Array:
    """Angle whose rate is a cosine of constant height, its frequency rising evenly over CHIRP_HZ after the rest."""
    t = np.arange(count) * STEP_S
    moving = np.clip(t - REST_S, 0.0, None)
    low, high = CHIRP_HZ
    phase = 2.0 * np.pi * (low * moving + 0.5 * (high - low) * moving**2 / max(t[-1] - REST_S, STEP_S))
    return np.asarray(np.cumsum(np.where(t > REST_S, rate_rad_s * np.cos(phase), 0.0)) * STEP_S)


def _steps(count: int, rate_rad_s: float, rng: np.random.Generator) -> Array:
    """Angle at constant rates, forth and back: each held for a random time, turned where the angle grows large."""
    wanted = np.zeros(count)
    k, angle, sign = round(REST_S / STEP_S), 0.0, 1.0
    while k < count:
        level = rate_rad_s * rng.choice([0.0, 0.5, 1.0])
        room_s = (LARGEST_ANGLE_RAD - sign * angle) / level if level > 0.0 else STEP_HOLD_S[1]
        hold = max(round(min(rng.uniform(*STEP_HOLD_S), room_s) / STEP_S), 1)
        steps = np.arange(1, min(hold, count - k) + 1)
        wanted[k : k + len(steps)] = angle + sign * level * STEP_S * steps
        k, angle = k + len(steps), wanted[k + len(steps) - 1]
        sign = -np.sign(angle) if abs(angle) > 0.5 * LARGEST_ANGLE_RAD else rng.choice([-1.0, 1.0])
    return wanted
