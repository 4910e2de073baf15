"""The state of now: the filter's, carried on by the inertial readings that wait, with the statistics of its errors.

A navigator is fed with a delay, so that readings of old instants find their place; the state that is sent, and that an
autopilot uses, must be of now. One step is `carried`, the very law that moves the filter
(`estimation.motion.strapdown`), on one lane here and on the simulator's.

A program on board receives the rows of `NowRow`, and `live` sends them.
"""

from typing import Annotated, Generic, NamedTuple, TypeVar

from flownav.core.compile import (
    ONE_LANE,
    Work,
    compiled,
    cos,
    equation,
    places_of,
    procedure,
    row_of,
    row_view,
    sin,
    width_of,
)
from flownav.core.frames import Rotation, heading_from_quaternion, rotation_from_quaternion, to_body
from flownav.estimation.covariance import covariance_of
from flownav.estimation.motion import errors_in_motion, strapdown
from flownav.estimation.named import AccelBias, Attitude, GyroBias, Inertial, PositionNed, VelocityNed
from flownav.estimation.states import (
    ACCEL_NOISE,
    ATTITUDE,
    GYRO_BIAS,
    GYRO_NOISE,
    POSITION,
    ROWS_BY_NAME,
    STATES,
    VELOCITY,
)
from flownav.estimation.transition import block_ahead, block_place
from flownav.navigation.inertial import Motion, last_motion, motion_between
from flownav.navigation.memory import CLOCK, MEMORY, PROTECTION, SUSPECTED, load_aid, load_imu, shared
from flownav.navigation.packed import load_equipment, load_filter_settings, load_imu_settings
from flownav.navigation.waiting import load_inertial, load_queue, load_sizes, ring_row

Value = TypeVar("Value")
Six = tuple[float, float, float, float, float, float]
Three = tuple[float, float, float]

_strapdown = compiled(strapdown.law)
_law = errors_in_motion.law
_errors_ahead = block_ahead(_law)
# of position, velocity and attitude: where each one's column begins in the block, and its row of a column
_nine = [block_place(_law, first + i) for first in (POSITION, VELOCITY, ATTITUDE) for i in range(3)]
NINE_COLUMNS, NINE_ROWS = tuple(column for column, _ in _nine), tuple(row for _, row in _nine)
POSE = (0, 1, 2, 6, 7, 8)  # of the nine: position and attitude


class NowRow(NamedTuple, Generic[Value]):
    """The state at an instant, carried ahead_s seconds on by inertial readings. Body axes are forward, right, down.
    status: of `progress.NOW_STATUSES`; the rest stands only where that is FLOWNAV_TOLD.

    quaternion: body to earth, w first. rate_frd_rad_s: 0 where no inertial unit serves. Covariances are the upper
    triangles row by row: of north, east, down [m] and roll, pitch, yaw [rad]; of the velocity in earth's axes and in
    the body's; of the gyro's bias [(rad/s)^2]. protection_m: levels, horizontal and vertical; NaN where none are kept.
    aid_age_s: since something horizontal was fused, NaN before the start; aid: 0, 1 dead reckoning, 2 invalid.
    suspected: 0, or 1 and the number of the fault that innovations show (`hypotheses.NAMES`).
    """

    status: Value
    t_s: Value
    ahead_s: Value
    pos_ned_m: Annotated[Value, 3]
    vel_ned_m_s: Annotated[Value, 3]
    vel_frd_m_s: Annotated[Value, 3]
    quaternion: Annotated[Value, 4]
    rate_frd_rad_s: Annotated[Value, 3]
    pose_covariance: Annotated[Value, 21]
    vel_ned_covariance: Annotated[Value, 6]
    vel_frd_covariance: Annotated[Value, 6]
    rate_covariance: Annotated[Value, 6]
    protection_m: Annotated[Value, 2]
    aid_age_s: Value
    aid: Value
    suspected: Value


NOW_NUMBERS = width_of(NowRow)
AT = places_of(NowRow)


# -- the state ------------------------------------------------------------------------------------------------
class NowState(NamedTuple):
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


MEMORY.name(NowState, *(ROWS_BY_NAME[name] for name in NowState._fields))
state_of, _ = MEMORY.access(NowState)


@equation
def moved_on(s: NowState, between: Motion, dt_s: float) -> NowState:
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
    return NowState(
        moved.pos_n, moved.pos_e, moved.pos_d, moved.vel_n, moved.vel_e, moved.vel_d,
        moved.qw, moved.qx, moved.qy, moved.qz,
        s.gyro_bias_x, s.gyro_bias_y, s.gyro_bias_z, s.accel_bias_x, s.accel_bias_y, s.accel_bias_z,
    )  # fmt: skip


@equation
def coasted(s: NowState, dt_s: float) -> NowState:
    """The state dt later where no IMU serves: attitude and velocity are held."""
    return NowState(
        s.pos_n + dt_s * s.vel_n, s.pos_e + dt_s * s.vel_e, s.pos_d + dt_s * s.vel_d, s.vel_n, s.vel_e, s.vel_d,
        s.qw, s.qx, s.qy, s.qz,
        s.gyro_bias_x, s.gyro_bias_y, s.gyro_bias_z, s.accel_bias_x, s.accel_bias_y, s.accel_bias_z,
    )  # fmt: skip


@procedure
def state_now(work: Work, r: Work, p: Work, t_s: float) -> tuple[NowState, Three]:
    """The state at an instant, and the body rate then; after the last inertial reading the last stands."""
    state, at_s = state_of(work, ONE_LANE, 0), shared(work, ONE_LANE, CLOCK)
    rate = (0.0, 0.0, 0.0)
    if load_equipment(p).use_imu:
        integrates = load_imu_settings(p).imu_integrates
        before = last_motion(load_imu(work, ONE_LANE, 0))
        state, at_s, before = _through_readings(r, state, at_s, before, integrates, t_s)
        if t_s > at_s:
            state = moved_on(state, before, t_s - at_s)
        rate = (before[0] - state.gyro_bias_x, before[1] - state.gyro_bias_y, before[2] - state.gyro_bias_z)
    else:
        state = coasted(state, t_s - at_s)
    return state, rate


@equation
def _through_readings(
    r: Work, state: NowState, at_s: float, before: Motion, integrates: float, t_s: float
) -> tuple[NowState, float, Motion]:
    """Through the readings later than at_s that are no spikes."""
    s, q, clock_s = load_sizes(r, ONE_LANE, 0), load_queue(r, ONE_LANE, 0), at_s
    for k in range(int(q.count)):
        one = load_inertial(r, ONE_LANE, ring_row(s, q.first, k), 0)
        if one.order > 0.0 and one.t_s > clock_s:
            now = (one.gyro_x, one.gyro_y, one.gyro_z, one.accel_x, one.accel_y, one.accel_z)
            until_s = min(one.t_s, t_s)
            if until_s > at_s:
                state = moved_on(state, motion_between(before, now, integrates), until_s - at_s)
                at_s = until_s
            before = now
    return state, at_s, before


# -- covariances --------------------------------------------------------------------------------------------
@equation
def _ahead(work: Work, i: int, j: int) -> float:
    """The covariance of two of the nine states of motion, carried on, which lies in the filter's scratch."""
    value: float = work[NINE_COLUMNS[j] + NINE_ROWS[i]]
    return value


@procedure
def carry_covariance(work: Work, p: Work, dt_s: float) -> None:
    """The covariance of position, velocity and attitude dt later: one step of the filter's law, into its scratch.

    Force, attitude and noise are those of the filter's last step; the covariance itself stays as it is.
    """
    _errors_ahead(work, ONE_LANE, STATES, dt_s=dt_s)
    walk = load_filter_settings(p).position_walk_m_rt_s
    for axis in range(3):
        k = NINE_COLUMNS[axis] + NINE_ROWS[axis]
        work[k] += walk * walk * dt_s
        k = NINE_COLUMNS[3 + axis] + NINE_ROWS[3 + axis]
        work[k] += dt_s * work[ACCEL_NOISE + axis // 2]
        k = NINE_COLUMNS[6 + axis] + NINE_ROWS[6 + axis]
        work[k] += dt_s * work[GYRO_NOISE]


@procedure
def put_pose(work: Work, out: Work, at: int, heading_rad: float) -> None:
    """The pose's covariance, of which a small rotation about north and east is one of roll and pitch by the heading."""
    cosine, sine = cos(heading_rad), sin(heading_rad)
    for i in range(6):
        for j in range(i, 6):
            out[at] = _turned(work, i, j, cosine, sine)
            at += 1


@equation
def _half_turned(work: Work, i: int, j: int, cosine: float, sine: float) -> float:
    """Element (i, j) of T P, where T turns north and east tilt into roll and pitch."""
    if i == 3:
        return cosine * _ahead(work, 6, POSE[j]) + sine * _ahead(work, 7, POSE[j])
    if i == 4:
        return cosine * _ahead(work, 7, POSE[j]) - sine * _ahead(work, 6, POSE[j])
    return _ahead(work, POSE[i], POSE[j])


@procedure
def _turned(work: Work, i: int, j: int, cosine: float, sine: float) -> float:
    """Element (i, j) of T P T'."""
    if j == 3:
        return _half_turned(work, i, 3, cosine, sine) * cosine + _half_turned(work, i, 4, cosine, sine) * sine
    if j == 4:
        return _half_turned(work, i, 4, cosine, sine) * cosine - _half_turned(work, i, 3, cosine, sine) * sine
    return _half_turned(work, i, j, cosine, sine)


@equation
def velocity_covariance(work: Work) -> Six:
    """Of the velocity NED, upper triangle."""
    return (
        _ahead(work, 3, 3), _ahead(work, 3, 4), _ahead(work, 3, 5), _ahead(work, 4, 4), _ahead(work, 4, 5),
        _ahead(work, 5, 5),
    )  # fmt: skip


@equation
def in_body(rotation: Rotation, c: Six) -> Six:
    """R' C R: a covariance of earth's axes in those of the body; upper triangles."""
    columns = (
        to_body(rotation, c[0], c[1], c[2]),
        to_body(rotation, c[1], c[3], c[4]),
        to_body(rotation, c[2], c[4], c[5]),
    )
    x = to_body(rotation, columns[0][0], columns[1][0], columns[2][0])
    y = to_body(rotation, columns[0][1], columns[1][1], columns[2][1])
    z = to_body(rotation, columns[0][2], columns[1][2], columns[2][2])
    return x[0], x[1], x[2], y[1], y[2], z[2]


@equation
def rate_covariance(work: Work) -> Six:
    """Of the gyro's bias, upper triangle."""
    return (
        covariance_of(work, ONE_LANE, GYRO_BIAS, GYRO_BIAS, 0),
        covariance_of(work, ONE_LANE, GYRO_BIAS, GYRO_BIAS + 1, 0),
        covariance_of(work, ONE_LANE, GYRO_BIAS, GYRO_BIAS + 2, 0),
        covariance_of(work, ONE_LANE, GYRO_BIAS + 1, GYRO_BIAS + 1, 0),
        covariance_of(work, ONE_LANE, GYRO_BIAS + 1, GYRO_BIAS + 2, 0),
        covariance_of(work, ONE_LANE, GYRO_BIAS + 2, GYRO_BIAS + 2, 0),
    )


# -- all of it ----------------------------------------------------------------------------------------------
@procedure
def tell_now(work: Work, r: Work, p: Work, t_s: float, out: Work) -> None:
    """The numbers of `NowRow` at an instant, but its status. It leaves the navigator as it is, but for its scratch."""
    state, rate = state_now(work, r, p, t_s)
    clock_s = shared(work, ONE_LANE, CLOCK)
    rotation = rotation_from_quaternion(state.qw, state.qx, state.qy, state.qz)
    carry_covariance(work, p, max(t_s - clock_s, 0.0))
    out[AT.t_s] = t_s
    out[AT.ahead_s] = t_s - clock_s
    for i in range(3):
        out[AT.pos_ned_m + i] = state[i]
        out[AT.vel_ned_m_s + i] = state[3 + i]
        out[AT.rate_frd_rad_s + i] = rate[i]
    for i in range(4):
        out[AT.quaternion + i] = state[6 + i]
    _put(out, AT.vel_frd_m_s, to_body(rotation, state.vel_n, state.vel_e, state.vel_d))
    put_pose(work, out, AT.pose_covariance, heading_from_quaternion(state.qw, state.qx, state.qy, state.qz))
    velocity = velocity_covariance(work)
    _put(out, AT.vel_ned_covariance, velocity)
    _put(out, AT.vel_frd_covariance, in_body(rotation, velocity))
    _put(out, AT.rate_covariance, rate_covariance(work))
    for i in range(2):
        out[AT.protection_m + i] = row_of(work, ONE_LANE, PROTECTION + i, 0)
    aid = load_aid(work, ONE_LANE, 0)
    out[AT.aid_age_s] = t_s - aid.aided_s
    out[AT.aid] = aid.flag
    out[AT.suspected] = row_of(work, ONE_LANE, SUSPECTED, 0)


@equation
def _put(out: Work, at: int, values: tuple[float, ...]) -> None:
    """Numbers one after the other."""
    for i in range(len(values)):
        out[at + i] = values[i]


now_row = row_view(NowRow)  # a row of numbers, by name
