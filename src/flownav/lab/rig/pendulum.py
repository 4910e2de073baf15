"""The pendulum with adjustable length: equations 12 to 16, and its motion.

The pivot is l0 above the pad, the sensor hangs l = l0 - h below it, h above the pad at rest. The angle theta is
positive towards +x. The paper's equations 13 to 15 are kept as printed (z upwards, velocities by derivative).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flownav.core.compile import cos, equation, kernel, runge_kutta, sin, stepping
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
