"""Parts of a judge's verdict beyond its memory, and what takes them: an offer to the filter, an event, a state reset, a
doubt.

A judge is `judge(reading, estimates, memory, settings) -> verdict` on one lane's records, decorated with `on_lanes`:
the loop over lanes, the loads and the stores are generated, and each part of a verdict goes where it belongs. Nothing
is left in rows for a later function to find.
"""

from typing import NamedTuple

import numpy as np

from flownav.core.compile import Lanes, Work, equation
from flownav.core.frames import Rotation
from flownav.estimation.covariance import add_noise_lane, covariance_of, variance_of
from flownav.estimation.hypotheses import leave, sign
from flownav.estimation.motion import rotation_of
from flownav.estimation.states import (
    ACCEL_BIAS,
    ACCEL_NOISE,
    ACCEPTED,
    FORCE,
    GROUND,
    GYRO_BIAS,
    GYRO_NOISE,
    GYRO_SHARE,
    HELD_BACK,
    IMU,
    INNOVATION,
    INNOVATION_VARIANCE,
    MEASURED,
    NOISE,
    OFFERED,
    POSITION,
    STATE,
    VELOCITY,
)
from flownav.navigation.journal import reset_state
from flownav.navigation.memory import MEMORY, OBSERVATION, REASON
from flownav.navigation.tape import Output, write_event


# -- what a judge is given of the filter ----------------------------------------------------------------------
class Biases(NamedTuple):
    """The filter's estimate of the gyro's biases [rad/s] and the accelerometer's [m/s2], body FRD."""

    gyro_x: float
    gyro_y: float
    gyro_z: float
    accel_x: float
    accel_y: float
    accel_z: float


class Force(NamedTuple):
    """The specific force of the step that was just made, biases off, NED [m/s2]."""

    north_m_s2: float
    east_m_s2: float
    down_m_s2: float


class AppliedMotion(NamedTuple):
    """The motion that moves the filter over the next step: gyro [rad/s] and specific force [m/s2], body FRD, biases
    included.
    """

    gyro_x: float
    gyro_y: float
    gyro_z: float
    accel_x: float
    accel_y: float
    accel_z: float


class MotionNoise(NamedTuple):
    """White noise of what moves the filter: densities level and down [(m/s2)^2/Hz], and of turning [(rad/s)^2/Hz]."""

    accel: float
    accel_down: float
    gyro: float


class Height(NamedTuple):
    """The filter's height: down [m], its speed's standard deviation [m/s], and R_33."""

    pos_d_m: float
    speed_sigma_m_s: float
    upright: float


class Tested(NamedTuple):
    """Outcome of the component that was offered last: its fate (`reasons`), innovation, h P h' + R, and R."""

    reason: float
    innovation: float
    total: float
    variance: float


class GroundBelow(NamedTuple):
    """The filter's estimate of the ground below: the height over it [m], the variance of that [m2], and R_EB."""

    height_m: float
    variance: float
    rotation: Rotation


class AxisVelocity(NamedTuple):
    """One axis of the filter's velocity, NED [m/s], and its variance."""

    speed_m_s: float
    variance: float


class AxisBias(NamedTuple):
    """The filter's estimate of the gyro's bias about one body axis [rad/s], and its variance."""

    rad_s: float
    variance: float


class Anywhere(NamedTuple):
    """Whether something is so in any lane."""

    any: bool


# -- what a judge returns ---------------------------------------------------------------------------------------
class Offer(NamedTuple):
    """One component for the filter: its value and variance; reason: FUSED where it may be tested, or why not."""

    measured: float
    variance: float
    reason: int


class Observation(NamedTuple):
    """The value written as measured, where that is not the value that the law reads."""

    value: float


class Accepted(NamedTuple):
    """1 where the component that was offered last was fused."""

    accepted: float


class Fate(NamedTuple):
    """The reason alone: FUSED where what lies in the observation's rows is offered."""

    reason: float


class Noise(NamedTuple):
    """The variance alone, of the component that is about to be tested."""

    variance: float


class Offered(NamedTuple):
    """Above 0 in the lanes that offer the component at hand to the filter."""

    offered: float


class Measured(NamedTuple):
    """The value that the law is compared with, where that is not the offered value."""

    measured: float


class GyroShare(NamedTuple):
    """Share of the filter's gyro bias in the flow reading at hand."""

    share: float


class HeldBack(NamedTuple):
    """Above 0 in the lanes that test readings and fuse none."""

    held: float


class Event(NamedTuple):
    """A happening of `tape.EVENT_NAMES`; kind below 0: nothing happened."""

    kind: np.int_ | int
    value: float


class Reset(NamedTuple):
    """A state that loses its correlations: its place, value (NaN: it stays) and variance; place below 0: none."""

    state: int
    value: float
    variance: float


class Sign(NamedTuple):
    """The change that one unit of a fault of `hypotheses` makes to the component that is offered."""

    fault: int
    value: float


class Doubt(NamedTuple):
    """A state that is less sure by this variance; 0: as sure as before."""

    state: int
    variance: float


class Left(NamedTuple):
    """The error that a fault may have left undetected in a state, which was taken for something else."""

    state: int
    value: float


UNKNOWN_M = 100.0  # the doubt of a ground, an origin or a pad that is about to be found: more than a first fix errs

NO_EVENT = Event(-1, 0.0)
NO_RESET = Reset(-1, 0.0, 0.0)


@equation
def height_of(work: Work, lanes: Lanes, lane: int) -> Height:
    """The filter's height in a lane."""
    return Height(
        work[(STATE + POSITION + 2) * len(lanes) + lane],
        np.sqrt(variance_of(work, lanes, VELOCITY + 2, lane)),
        rotation_of(work, lanes, lane)[8],
    )


@equation
def ground_below(work: Work, lanes: Lanes, lane: int) -> GroundBelow:
    """The filter's estimate of the ground below a lane's vehicle."""
    height_m = work[(STATE + GROUND) * len(lanes) + lane] - work[(STATE + POSITION + 2) * len(lanes) + lane]
    both = variance_of(work, lanes, POSITION + 2, lane) + variance_of(work, lanes, GROUND, lane)
    variance = both - 2.0 * covariance_of(work, lanes, POSITION + 2, GROUND, lane)
    return GroundBelow(height_m, variance, rotation_of(work, lanes, lane))


@equation
def axis_velocity(work: Work, lanes: Lanes, axis: int, lane: int) -> AxisVelocity:
    """One axis of a lane's velocity."""
    speed_m_s = work[(STATE + VELOCITY + axis) * len(lanes) + lane]
    return AxisVelocity(speed_m_s, variance_of(work, lanes, VELOCITY + axis, lane))


@equation
def axis_bias(work: Work, lanes: Lanes, axis: int, lane: int) -> AxisBias:
    """The bias of a lane's gyro about one axis."""
    rad_s = work[(STATE + GYRO_BIAS + axis) * len(lanes) + lane]
    return AxisBias(rad_s, variance_of(work, lanes, GYRO_BIAS + axis, lane))


@equation
def offer(work: Work, lanes: Lanes, lane: int, given: Offer) -> None:
    """Put a component before its law; `conclude` follows."""
    work[MEASURED * len(lanes) + lane] = given.measured
    work[OBSERVATION * len(lanes) + lane] = given.measured
    work[NOISE * len(lanes) + lane] = given.variance
    work[REASON * len(lanes) + lane] = given.reason


@equation
def tell(work: Work, lanes: Lanes, lane: int, event: Event, t_s: float, o: Output) -> None:
    """Write an event down."""
    if event.kind >= 0:
        write_event(lanes, lane, t_s, event.kind, event.value, o)


@equation
def reset(work: Work, lanes: Lanes, lane: int, given: Reset, o: Output) -> None:
    """Reset a state."""
    if given.state >= 0:
        before = work[(STATE + given.state) * len(lanes) + lane]
        work[(STATE + given.state) * len(lanes) + lane] = before if np.isnan(given.value) else given.value
        reset_state(work, lanes, lane, given.state, given.variance, o)


@equation
def note_sign(work: Work, lanes: Lanes, lane: int, given: Sign) -> None:
    """Note what a fault adds."""
    sign(work, lanes, given.fault, lane, given.value)


@equation
def doubt(work: Work, lanes: Lanes, lane: int, given: Doubt) -> None:
    """Add to a state's variance."""
    add_noise_lane(work, lanes, given.state, lane, given.variance)


@equation
def note_left(work: Work, lanes: Lanes, lane: int, given: Left) -> None:
    """Note what may be wrong with a state."""
    leave(work, lanes, given.state, lane, given.value)


MEMORY.name(Biases, *(STATE + GYRO_BIAS + i for i in range(3)), *(STATE + ACCEL_BIAS + i for i in range(3)))
MEMORY.name(Force, *(FORCE + i for i in range(3)))
MEMORY.name(AppliedMotion, *(IMU + i for i in range(6)))
MEMORY.name(MotionNoise, ACCEL_NOISE, ACCEL_NOISE + 1, GYRO_NOISE)
MEMORY.name(Observation, OBSERVATION)
MEMORY.name(Accepted, ACCEPTED)
MEMORY.name(Tested, REASON, INNOVATION, INNOVATION_VARIANCE, NOISE)
MEMORY.name(Fate, REASON)
MEMORY.name(Noise, NOISE)
MEMORY.name(Offered, OFFERED)
MEMORY.name(Measured, MEASURED)
MEMORY.name(GyroShare, GYRO_SHARE)
MEMORY.name(HeldBack, HELD_BACK)
MEMORY.derive(Height, height_of)
MEMORY.derive(GroundBelow, ground_below)
MEMORY.derive(AxisVelocity, axis_velocity, "axis")
MEMORY.derive(AxisBias, axis_bias, "axis")
MEMORY.sink(Offer, offer)
MEMORY.sink(Event, tell, "t_s", "o")
MEMORY.sink(Reset, reset, "o")
MEMORY.sink(Sign, note_sign)
MEMORY.sink(Doubt, doubt)
MEMORY.sink(Left, note_left)

on_lanes = MEMORY.on_lanes
