"""From the filter's instant to a later one: its state carried on by the IMU readings in between.

A navigator is fed with a delay, so that readings of old instants find their place; what is sent, and what an autopilot
flies on, must be of now. One step is `carried`, the very law that moves the filter (`estimation.motion.strapdown`), on
one lane here and on the simulator's; its covariance is moved by that motion's own transition and noise.
"""

from typing import NamedTuple

import numpy as np

from flownav.core.compile import ONE_LANE, compiled, equation, kernel, pointer
from flownav.core.measurement import Array
from flownav.estimation.consistency import pack, unpack
from flownav.estimation.law import Signature
from flownav.estimation.motion import add_motion_noise, errors_in_motion, strapdown
from flownav.estimation.named import AccelBias, Attitude, GyroBias, Inertial, PositionNed, VelocityNed
from flownav.estimation.states import (
    PLACES,
    ROWS_BY_NAME,
    STATES,
)
from flownav.navigation.inertial import Motion, motion_between, remembered
from flownav.navigation.memory import CLOCK, MEMORY, load_imu
from flownav.navigation.packed import load_equipment, load_imu_settings

AHEAD_NUMBERS = 13  # position NED [m], velocity NED [m/s], quaternion body to earth, body rate [rad/s]

_strapdown = compiled(strapdown.law)
_IN_MOTION = Signature.of(errors_in_motion.law)


class Carried(NamedTuple):
    """A state on its way: position NED [m], velocity NED [m/s], quaternion body to earth, and the IMU's biases."""

    pos_n: float
    pos_e: float
    pos_d: float
    vel_n: float
    vel_e: float
    vel_d: float
    qw: float
    qx: float
    qy: float
    qz: float
    gyro_bias_x: float
    gyro_bias_y: float
    gyro_bias_z: float
    accel_bias_x: float
    accel_bias_y: float
    accel_bias_z: float


MEMORY.name(Carried, *(ROWS_BY_NAME[name] for name in Carried._fields))
state_of, _ = MEMORY.access(Carried)


@equation
def carried(s: Carried, between: Motion, dt_s: float) -> Carried:
    """The state dt later; between: what the IMU read over that time, biases and all (`inertial.motion_between`)."""
    moved = _strapdown(
        PositionNed(s.pos_n, s.pos_e, s.pos_d),
        VelocityNed(s.vel_n, s.vel_e, s.vel_d),
        Attitude(s.qw, s.qx, s.qy, s.qz),
        Inertial(between[0], between[1], between[2], between[3], between[4], between[5]),
        GyroBias(s.gyro_bias_x, s.gyro_bias_y, s.gyro_bias_z),
        AccelBias(s.accel_bias_x, s.accel_bias_y, s.accel_bias_z),
        dt_s,
    )
    return Carried(
        moved.pos_n, moved.pos_e, moved.pos_d, moved.vel_n, moved.vel_e, moved.vel_d,
        moved.qw, moved.qx, moved.qy, moved.qz,
        s.gyro_bias_x, s.gyro_bias_y, s.gyro_bias_z, s.accel_bias_x, s.accel_bias_y, s.accel_bias_z,
    )  # fmt: skip


@equation
def coasted(s: Carried, dt_s: float) -> Carried:
    """The state dt later where no IMU serves: attitude and velocity are held."""
    return Carried(
        s.pos_n + dt_s * s.vel_n, s.pos_e + dt_s * s.vel_e, s.pos_d + dt_s * s.vel_d, s.vel_n, s.vel_e, s.vel_d,
        s.qw, s.qx, s.qy, s.qz,
        s.gyro_bias_x, s.gyro_bias_y, s.gyro_bias_z, s.accel_bias_x, s.accel_bias_y, s.accel_bias_z,
    )  # fmt: skip


@kernel
def ahead(work: Array, settings: Array, imu: Array, t_s: float, out: Array) -> None:
    """out (AHEAD_NUMBERS,): the state of one lane at t_s. settings: packed.

    imu (n, 7): time and reading of those later than the filter's clock, in order. After the last of them, the last
    stands. The body rate is 0 where no IMU serves.
    """
    lanes = ONE_LANE
    rows, told = pointer(work), pointer(settings)
    state = state_of(rows, lanes, 0)
    at_s = work[CLOCK]
    rate = (0.0, 0.0, 0.0)
    if load_equipment(told).use_imu:
        integrates = load_imu_settings(told).imu_integrates
        before = remembered(load_imu(rows, lanes, 0))
        for k in range(len(imu)):
            now = (imu[k, 1], imu[k, 2], imu[k, 3], imu[k, 4], imu[k, 5], imu[k, 6])
            until_s = min(imu[k, 0], t_s)
            if until_s > at_s:
                state = carried(state, motion_between(before, now, integrates), until_s - at_s)
                at_s = until_s
            before = now
        if t_s > at_s:
            state = carried(state, before, t_s - at_s)
        rate = (before[0] - state.gyro_bias_x, before[1] - state.gyro_bias_y, before[2] - state.gyro_bias_z)
    else:
        state = coasted(state, t_s - at_s)
    for i in range(10):
        out[i] = state[i]
    for i in range(3):
        out[10 + i] = rate[i]


def state_at(work: Array, settings: Array, imu: Array, t_s: float) -> Array:
    """`ahead` into a new array."""
    out = np.empty(AHEAD_NUMBERS)
    ahead(work, settings, imu, t_s, out)
    return out


def covariance_at(work: Array, t_s: float, position_walk_m_rt_s: float) -> Array:
    """The covariance of one lane's states at t_s, (STATES, STATES): one step of the filter's law from its clock.

    The force, the attitude and the noise are those of the filter's last step.
    """
    held = {name: work[ROWS_BY_NAME[name]] for name in _IN_MOTION.names if name not in PLACES}
    dt_s = max(t_s - work[CLOCK], 0.0)
    covariance = unpack(work, ONE_LANE, 0, STATES)
    for _ in range(2):  # F P, and then F (F P)'
        errors = held | {name: covariance[PLACES[name]] for name in _IN_MOTION.names if name in PLACES}
        records = [parameter.record(*(errors[name] for name in parameter.names)) for parameter in _IN_MOTION.reads]
        for name, row in errors_in_motion.law(*records, dt_s=dt_s)._asdict().items():
            covariance[PLACES[name]] = row
        covariance = covariance.T
    rows = work.copy()
    pack(rows, ONE_LANE, 0, STATES, covariance)
    add_motion_noise(rows, ONE_LANE, dt_s, position_walk_m_rt_s)
    return unpack(rows, ONE_LANE, 0, STATES)
