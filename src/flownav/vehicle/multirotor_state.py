"""A multirotor's state, what its motors are told and what follows, as bundles of scalars."""

from __future__ import annotations

from typing import NamedTuple

from flownav.core.compile import equation, passing, replacing, stepping
from flownav.vehicle.state import settled, unit_attitude


class MultirotorState(NamedTuple):
    """A multirotor's state; of its rates where a function says so (then every unit is per second).

    The first thirteen are those of `state.HelicopterState`, in its order: the sensors look at these alone. speed_1..6:
    the rotors', clockwise from the front right [rad/s], a quad's last two are zero. used: charge taken from the full
    battery [A s].
    """

    pos_n: float
    pos_e: float
    pos_d: float
    u: float
    v: float
    w: float
    qw: float
    qx: float
    qy: float
    qz: float
    p: float
    q: float
    r: float
    speed_1: float
    speed_2: float
    speed_3: float
    speed_4: float
    speed_5: float
    speed_6: float
    used: float


class Six(NamedTuple):
    """A number for each rotor; a quad's last two are zero."""

    one: float
    two: float
    three: float
    four: float
    five: float
    six: float


@equation
def speeds_of(state: MultirotorState) -> Six:
    """The rotors' speeds [rad/s]."""
    return Six(state.speed_1, state.speed_2, state.speed_3, state.speed_4, state.speed_5, state.speed_6)


@equation
def total_of(x: Six) -> float:
    """The sum over the rotors."""
    return ((x.one + x.two) + (x.three + x.four)) + (x.five + x.six)


moved = stepping(MultirotorState)  # state + rate·dt


_settle = passing(MultirotorState, settled, "u", "v", "w", "p", "q", "r")
_turned = replacing(MultirotorState, "qw", "qx", "qy", "qz")


@equation
def of_unit_attitude(state: MultirotorState) -> MultirotorState:
    """The state with its quaternion brought back to unit length and its dying motions brought to rest."""
    w, x, y, z = unit_attitude(state)
    return _turned(_settle(state), qw=w, qx=x, qy=y, qz=z)
