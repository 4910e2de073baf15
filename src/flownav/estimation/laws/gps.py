"""GPS position and velocity, axis by axis (0 north, 1 east, 2 down), of an antenna at a lever from the IMU."""

from typing import NamedTuple

from flownav.core.frames import GRAVITY_M_S2, to_earth
from flownav.estimation.law import law
from flownav.estimation.laws import component, cross, turning
from flownav.estimation.named import Attitude, BodyRate, Lever, rotation_by


class OnPosition(NamedTuple):
    """The Jacobian of a GPS position."""

    pos: float
    gps_slow: float
    gps_fast: float
    tilt_n: float
    tilt_e: float
    heading: float


@law
def gps_position(
    axis: int, pos: float, gps_slow: float, gps_fast: float, q: Attitude, *, lever: Lever
) -> tuple[float, OnPosition]:
    """z = p + R l + slow + fast error [m], the antenna at l = (forward, right, below), body FRD.

    Groves 2013, section 14.3.1, with the receiver's correlated errors as states.
    """
    arm = to_earth(rotation_by(q), lever.forward_m, lever.right_m, lever.below_m)
    turn = turning(arm, axis)
    predicted = pos + component(arm, axis) + gps_slow + gps_fast
    return predicted, OnPosition(1.0, 1.0, 1.0, turn[0], turn[1], turn[2])


class OnVelocity(NamedTuple):
    """The Jacobian of a GPS velocity."""

    vel: float
    gps_velocity: float
    velocity_lag: float
    tilt_n: float
    tilt_e: float
    heading: float


@law
def gps_velocity(
    axis: int, vel: float, gps_velocity: float, velocity_lag: float, force: float, q: Attitude, rate: BodyRate,
    *, lever: Lever,
) -> tuple[float, OnVelocity]:  # fmt: skip
    """z = v + R (w x l) + error - lag a [m/s]: receivers smooth their velocity, so that it is older than they state.

    `a` is the acceleration of the last step and w the body rate in it. Their own errors, times the lag and the lever,
    are left out of the Jacobian.
    """
    accel = force + (GRAVITY_M_S2 if axis == 2 else 0.0)
    swing = cross(rate, lever)
    arm = to_earth(rotation_by(q), swing[0], swing[1], swing[2])
    turn = turning(arm, axis)
    predicted = vel + component(arm, axis) + gps_velocity - velocity_lag * accel
    return predicted, OnVelocity(1.0, 1.0, -accel, turn[0], turn[1], turn[2])
