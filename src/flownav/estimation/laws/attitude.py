"""Attitude and heading: an INS's or autopilot's attitude, a compass, a gap of the IMU that was bridged."""

from typing import NamedTuple

import numpy as np

from flownav.core.compile import arctan2, equation, larger
from flownav.core.frames import Quaternion, Vector, conjugate, quaternion_product, within_half_turn
from flownav.estimation.law import law
from flownav.estimation.laws import LEAST_UPRIGHT, component
from flownav.estimation.named import Attitude, InsError, ReadAttitude, rotation_by


@equation
def turn_between(read: Quaternion, own: Quaternion) -> Vector:
    """theta of q_read = (1, theta/2) q_own, for small angles [rad], earth NED."""
    w, x, y, z = quaternion_product(read, conjugate(own))
    twice = 2.0 if w.real >= 0.0 else -2.0
    return twice * x, twice * y, twice * z


class OnAttitude(NamedTuple):
    """The Jacobian of an external attitude."""

    attitude: float
    ins_roll: float
    ins_pitch: float
    ins_heading: float


@law
def attitude(axis: int, ins: InsError, q: Attitude, read: ReadAttitude) -> tuple[float, OnAttitude]:
    """An external attitude's rotation from the filter's, about one earth axis [rad].

    q_read q^-1 = theta + R (e_roll, e_pitch, 0) + (0, 0, e_heading), small angles; the quaternion is what is measured.
    """
    rotation = rotation_by(q)
    turn = turn_between(read, q)
    by_roll = component((rotation[0], rotation[3], rotation[6]), axis)
    by_pitch = component((rotation[1], rotation[4], rotation[7]), axis)
    by_heading = 1.0 if axis == 2 else 0.0
    error = by_roll * ins.ins_roll + by_pitch * ins.ins_pitch + by_heading * ins.ins_heading
    return component(turn, axis) - error, OnAttitude(1.0, by_roll, by_pitch, by_heading)


class OnLevel(NamedTuple):
    """The Jacobian of the direction of down."""

    tilt_n: float
    tilt_e: float
    ins_roll: float
    ins_pitch: float


@law
def level(axis: int, ins_roll: float, ins_pitch: float, q: Attitude) -> tuple[float, OnLevel]:
    """Where an external attitude puts down, body forward (axis 0) and right (1): d = R' e_d - e x R' e_d.

    Its heading has no part in it. e = (e_roll, e_pitch, 0), small angles; R' (e_d - theta x e_d) for a true
    R = (I + [theta]x) R_filter.
    """
    rotation = rotation_by(q)
    forward, right, down = rotation[6], rotation[7], rotation[8]
    by_n, by_e = rotation[5], -rotation[2]  # what tilting does to the third
    if axis == 0:
        return forward - down * ins_pitch, OnLevel(
            rotation[3] - by_n * ins_pitch, -rotation[0] - by_e * ins_pitch, 0.0, -down
        )
    return right + down * ins_roll, OnLevel(rotation[4] + by_n * ins_roll, -rotation[1] + by_e * ins_roll, down, 0.0)


class OnOwnAttitude(NamedTuple):
    """The Jacobian of an attitude without errors of its own."""

    attitude: float


@law
def bridged_attitude(axis: int, q: Attitude, read: ReadAttitude) -> tuple[float, OnOwnAttitude]:
    """q_read q^-1 = theta about one earth axis [rad]: an attitude that has white noise alone."""
    turn = turn_between(read, q)
    return component(turn, axis), OnOwnAttitude(1.0)


class OnHeading(NamedTuple):
    """The Jacobian of a heading."""

    tilt_n: float
    tilt_e: float
    heading: float
    ins_heading: float
    compass_sin: float
    compass_cos: float


@law
def heading(
    axis: int, ins_heading: float, compass_sin: float, compass_cos: float, q: Attitude, measured: float
) -> tuple[float, OnHeading]:
    """z = psi + A + B sin psi + C cos psi [rad], wrapped to half a turn: a compass, or a heading from elsewhere.

    A is the slow error of the heading (declination, mounting); B and C are the deviation that hard iron makes, which
    turns with the vehicle (0 of anything but a compass). psi = atan2(R_21, R_11).
    """
    rotation = rotation_by(q)
    forward_n, forward_e, forward_d = rotation[0], rotation[3], rotation[6]
    level = larger(forward_n * forward_n + forward_e * forward_e, LEAST_UPRIGHT * LEAST_UPRIGHT)
    cosine, sine = forward_n / np.sqrt(level), forward_e / np.sqrt(level)
    predicted = arctan2(forward_e, forward_n) + ins_heading + compass_sin * sine + compass_cos * cosine
    difference = measured - predicted
    by_heading = 1.0 + compass_sin * cosine - compass_cos * sine
    return within_half_turn(difference), OnHeading(
        tilt_n=-by_heading * forward_d * forward_n / level, tilt_e=-by_heading * forward_d * forward_e / level,
        heading=by_heading, ins_heading=1.0, compass_sin=sine, compass_cos=cosine,
    )  # fmt: skip
