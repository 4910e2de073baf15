"""What a navigator remembers of each lane, subject by subject, as named records; `memory` says where they lie."""

from __future__ import annotations

from typing import NamedTuple


class Reading(NamedTuple):
    """One reading of one sensor, its values as `measurement.COLUMNS` has them and the variances that it states.

    Flow has two values more, the vehicle's own turning over its exposure [rad/s]. A variance is NaN where none is
    stated. quality: 0..255. arrived: 0 in a lane whose sensor stayed silent. withheld: 1 where the user takes it away.
    """

    value_0: float
    value_1: float
    value_2: float
    value_3: float
    value_4: float
    value_5: float
    variance_0: float
    variance_1: float
    variance_2: float
    quality: float
    arrived: float
    withheld: float


class StartMemory(NamedTuple):
    """started: 1 once the filter runs. Before that, the newest attitude that was read and its time [s], the mean
    specific force [m/s2] of so many readings, and the mean square of an axis about it [m2/s4].
    """

    started: float
    attitude_s: float
    qw: float
    qx: float
    qy: float
    qz: float
    force_x: float
    force_y: float
    force_z: float
    readings: float
    shaken: float


class AidMemory(NamedTuple):
    """aided_s: when something horizontal was fused last; flag: 0, 1 dead reckoning, 2 invalid; height_s: when something
    other than the range told the height; landed: 1 on the ground.
    """

    aided_s: float
    flag: float
    height_s: float
    landed: float


class ImuMemory(NamedTuple):
    """The newest reading (gyro [rad/s], specific force [m/s2], body FRD) and its time; the mean square of its jumps
    [m2/s4]; how far the accelerometer is doubted along body down [m/s2]; gap: 1 after a stretch without readings.
    """

    read_s: float
    gyro_x: float
    gyro_y: float
    gyro_z: float
    accel_x: float
    accel_y: float
    accel_z: float
    vibration: float
    doubt_m_s2: float
    gap: float


class RangeMemory(NamedTuple):
    """taken_s: of the last range that was fused; refused_s: since when they are refused; last_m and same_s: the last
    value and since when it repeats; down_m: where the vehicle was then; said_s: of the repetition that was reported;
    doubted: 1 once the accelerometer was doubted for it.
    """

    taken_s: float
    refused_s: float
    last_m: float
    same_s: float
    down_m: float
    said_s: float
    doubted: float


class EchoMemory(NamedTuple):
    """The two newest ranges [m], where the vehicle was then (down [m]), and the share of ranges that no neighbour
    confirms.
    """

    newest_m: float
    newest_down_m: float
    older_m: float
    older_down_m: float
    stray: float


class GroundMemory(NamedTuple):
    """known: 1 once ranges have found the ground. A ground that would be new: candidate_m, its down coordinate by the
    newest range; since_s and first_m, when and by which range it was seen first; agreeing, by how many in a row;
    varied: 1 where these were not all the same to the last digit.
    """

    known: float
    candidate_m: float
    since_s: float
    first_m: float
    agreeing: float
    varied: float


class FlowMemory(NamedTuple):
    """taken_s: of the last tested flow; excess: how many times noisier than its model; bias of the sensor's own gyro
    [rad/s] and from how many readings; ratio: mean of nu^2 over its variance; doubted: 1 while that is too
    large; likeness: mean of `flow_noise.alike`; wrong_s: when that was too large last; -infinity where it is not;
    usual: the quality that it usually has.
    """

    taken_s: float
    excess: float
    bias_x: float
    bias_y: float
    bias_count: float
    ratio: float
    doubted: float
    likeness: float
    wrong_s: float
    usual: float


class HeadingMemory(NamedTuple):
    """read_s: when a heading was read last; field_rad: direction of the level magnetic field in the filter's frame."""

    read_s: float
    field_rad: float


class BridgeMemory(NamedTuple):
    """The filter's attitude at the last attitude reading before a gap of the IMU, that reading, and the variances."""

    own_w: float
    own_x: float
    own_y: float
    own_z: float
    read_w: float
    read_x: float
    read_y: float
    read_z: float
    variance_n: float
    variance_e: float
    variance_d: float


class SpikeMemory(NamedTuple):
    """How many inertial readings in a row were refused as spikes; the usual jump from one to the next, of gyro [rad/s]
    and accelerometer [m/s2]; the newest reading, spike or not; and the step in which the last jump was judged [s].
    """

    refused: float
    gyro_rad_s: float
    accel_m_s2: float
    gyro_x: float
    gyro_y: float
    gyro_z: float
    accel_x: float
    accel_y: float
    accel_z: float
    reach_s: float


class ImuWindow(NamedTuple):
    """Inertial readings of a window: how many, the first (turning p, q, r [rad/s], specific force x, y, z [m/s2]), sums
    of differences from it, and sums of their squares.
    """

    readings: float
    first_p: float
    first_q: float
    first_r: float
    first_x: float
    first_y: float
    first_z: float
    sum_p: float
    sum_q: float
    sum_r: float
    sum_x: float
    sum_y: float
    sum_z: float
    square_p: float
    square_q: float
    square_r: float
    accel_square: float


class SeenWindow(NamedTuple):
    """What else was read in a window: lowest and highest range [m] (the highest below 0: none), sums of the flow's
    velocity [m/s] and of how many, and the fastest level velocity by GPS [m/s].
    """

    range_low_m: float
    range_high_m: float
    flow_u_m_s: float
    flow_v_m_s: float
    flows: float
    gps_m_s: float


class NoiseMemory(NamedTuple):
    """factor: a component's noise over what is said of it [variance]; its innovation before, and when that was [s]."""

    factor: float
    before: float
    heard_s: float


class CourseMemory(NamedTuple):
    """The way as GPS and the flow saw it, weighed by time: sums of v.w and v x w [m2/s], and of both squares; its
    length [m]; when GPS was heard and the flow [s]; the flow's smoothed velocity by the filter's own heading [m/s].
    """

    along: float
    across: float
    gps: float
    flow: float
    travel_m: float
    gps_s: float
    flow_s: float
    north_m_s: float
    east_m_s: float


class PushMemory(NamedTuple):
    """What the accelerometer adds to the velocity in a block, north and east by the filter's own heading [m/s]; GPS
    velocity at its start, and when that was [s]; sums over blocks as of `CourseMemory`, of changes of velocity [m2/s2].
    """

    push_n: float
    push_e: float
    v_n: float
    v_e: float
    since_s: float
    along: float
    across: float
    gps: float
    own: float


class WhitenessMemory(NamedTuple):
    """A block of innovations along one body axis: since when [s], their sum in standard deviations, how many. The block
    before, the mean square of blocks, and when it ended [s].
    """

    since_s: float
    total: float
    readings: float
    before: float
    square: float
    ended_s: float


class RejectionMemory(NamedTuple):
    """How often GPS was refused for one state, one after the other, and since when."""

    times: float
    since_s: float
