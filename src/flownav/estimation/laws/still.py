"""States read as they are: an external position, and a vehicle at rest, whose velocity and turning are 0."""

from typing import NamedTuple

from flownav.estimation.law import law


class OnOwnPosition(NamedTuple):
    """The Jacobian of a position."""

    pos: float


@law
def position_itself(axis: int, pos: float) -> tuple[float, OnOwnPosition]:
    """z = p [m], local NED: an external pose."""
    return pos, OnOwnPosition(1.0)


class OnOwnVelocity(NamedTuple):
    """The Jacobian of a velocity."""

    vel: float


@law
def velocity_itself(axis: int, vel: float) -> tuple[float, OnOwnVelocity]:
    """z = v [m/s], NED: 0 of a vehicle at rest."""
    return vel, OnOwnVelocity(1.0)


class OnPadBelow(NamedTuple):
    """The Jacobian of a pad that one stands on."""

    pad: float
    pos: float


@law
def pad_below(axis: int, pad: float, pos: float) -> tuple[float, OnPadBelow]:
    """z = pad - p [m], NED: 0 of a vehicle that stands where its pad is."""
    return pad - pos, OnPadBelow(1.0, -1.0)


class OnGyroBias(NamedTuple):
    """The Jacobian of a gyro at rest."""

    gyro_bias: float


@law
def gyro_at_rest(axis: int, gyro_bias: float) -> tuple[float, OnGyroBias]:
    """z = b [rad/s], body FRD: what a gyro reads when nothing turns."""
    return gyro_bias, OnGyroBias(1.0)
